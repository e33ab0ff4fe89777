"""An individual: what sets one robot apart from its description, and masses that it holds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Annotated

import mujoco
import numpy as np
import tomlkit
from msgspec import Meta

from robots import quaternion
from robots.storage.files import write_atomically
from robots.storage.toml_document import table_of
from robots.storage.validation import between, read_toml, reading, shown

IDENTIFIED_FILE = "identified.toml"
TOLD = "robot", "intervals"  # which make no difference by themselves
ROUNDING = 1e-3  # of what is written with five digits
DENSITY = 1000.0  # kg/m³, of held masses: that of water
LINEAR = 1  # interpolation between two targets of a delayed actuator
Ends = Annotated[tuple[float, float], Meta(description="the two ends of an interval")]


class IndividualError(ValueError):
    """A file of what sets a robot apart cannot be used."""


@dataclass(frozen=True, kw_only=True)
class Individual:
    """What sets one robot apart from its description; nothing by default."""

    robot: str = ""
    """Name of the robot."""
    strength: Annotated[float, between(0.1, 3.0)] = 1.0
    """Factor on torque and position gain of all servos."""
    friction: Annotated[float, between(0.0, 20.0)] = 1.0
    """Factor on the dry friction of all joints."""
    mass: Annotated[float, between(0.2, 5.0)] = 1.0
    """Factor on the masses and inertias of all links."""
    delay: Annotated[float, between(0.0, 0.2, "s")] = 0.0
    """Age of targets when they act [s]."""
    com: Annotated[float, between(-0.2, 0.2, "m")] = 0.0
    """Shift of the torso's center of mass along its x axis [m]."""
    load_friction: Annotated[float, between(0.0, 0.9)] = 0.0
    """Further friction of all gears per torque of the motor."""
    imu_tilt: Annotated[tuple[float, float, float], Meta(description="three angles in rad")] = (
        0.0,
        0.0,
        0.0,
    )
    """Rotation vector from the IMU's described mounting to the true one, in its frame [rad]."""
    supply_resistance: Annotated[float, between(0.0, 10.0, "Ω")] | None = None
    """Resistance of battery and wires [Ω]; None for that of the description."""
    intervals: Annotated[dict[str, Ends], Meta(description="a table of intervals")] = field(
        default_factory=dict, hash=False
    )
    """95 % intervals of figures."""

    @property
    def is_as_described(self) -> bool:
        """Return whether no figure differs from the description."""
        return not str(self)

    def __str__(self) -> str:
        """Return what differs from the description in one line; empty if nothing does."""
        usual, own = vars(AS_DESCRIBED), vars(self)
        differing = [name for name in own if name not in TOLD and own[name] != usual[name]]
        return ", ".join(f"{name} {_rounded(own[name])}" for name in differing)

    def relative(self, name: str) -> tuple[float, float]:
        """Return the interval of a factor as shares of its value; (1, 1) if it has none."""
        value = getattr(self, name)
        lower, upper = self.intervals.get(name, (value, value))
        return (lower / value, upper / value) if value > 0.0 else (1.0, 1.0)

    def shape(self, spec: mujoco.MjSpec, torso: str, imu_site: str | None) -> None:
        """Give a robot's model, with its servos, its masses, IMU mounting and delay."""
        if self.mass != 1.0 or self.com != 0.0:
            make_explicit(spec)
            for body in spec.bodies[1:]:
                body.mass *= self.mass
                body.inertia = body.inertia * self.mass
            trunk = spec.body(torso)
            trunk.ipos = trunk.ipos + np.array([self.com, 0.0, 0.0])
        if imu_site is not None and any(self.imu_tilt):
            site, tilt = spec.site(imu_site), np.array(self.imu_tilt)
            angle = float(np.linalg.norm(tilt))
            site.quat = quaternion.multiply(
                site.quat, quaternion.from_axis_angle(tilt / angle, np.array(angle))
            )
        if self.delay >= 0.5 * spec.option.timestep:  # any delay acts for a whole step at least
            for actuator in spec.actuators:
                actuator.nsample = int(np.ceil(self.delay / spec.option.timestep)) + 1
                actuator.delay, actuator.interp = self.delay, LINEAR

    def save(self, path: Path, about: Sequence[str]) -> None:
        """Write the file, with comments at its head."""
        document = tomlkit.document()
        for line in about:
            document.add(tomlkit.comment(line))
        for each in fields(self):
            value = getattr(self, each.name)
            if each.name != "intervals" and value != each.default:
                document.add(each.name, tomlkit.item(_rounded(value)))
        intervals = {name: _rounded(ends) for name, ends in self.intervals.items()}
        document.add("intervals", table_of(intervals))
        write_atomically(path, document.as_string().rstrip() + "\n")

    @classmethod
    def load(cls, path: Path, robot: str) -> Individual:
        """Load the individual of a robot; the error names all that is wrong."""
        advice = " (make a new one: getup identify robot)"
        with reading(f"file {path}", IndividualError, advice) as problems:
            found = read_toml(cls, path, problems)
            if found.robot != robot:
                problems.append(f"it is of robot {shown(found.robot)}, expected {shown(robot)}")
            known = {f.name for f in fields(cls) if isinstance(getattr(found, f.name), float)}
            problems += [
                f"intervals.{name} is not known, expected a figure of this file"
                for name in found.intervals
                if name not in known
            ]
            for name, ends in found.intervals.items() if not problems else ():
                value = getattr(found, name)
                if not ends[0] - ROUNDING <= value <= ends[1] + ROUNDING:
                    problems.append(
                        f"intervals.{name} is {list(ends)}, expected it about {name}, {value:g}"
                    )
            if any(abs(angle) > np.pi for angle in found.imu_tilt):
                problems.append(f"imu_tilt is {list(found.imu_tilt)}, expected angles in rad")
            return found


AS_DESCRIBED = Individual()
"""A robot that differs in nothing from its description."""


@dataclass(frozen=True, eq=False)
class HeldMass:
    """A mass on a body of a robot: a ball without shape."""

    name: str
    mass: float
    """[kg]"""
    body: str
    position: quaternion.Array
    """In the body's frame [m], (3,)."""

    def fix(self, spec: mujoco.MjSpec) -> None:
        """Fix it to its body in a model."""
        make_explicit(spec)  # a compiler may spread the old total over the new masses
        radius = (0.75 / np.pi * self.mass / DENSITY) ** (1.0 / 3.0)
        ball = spec.body(self.body).add_body(name=f"load_{self.name}", mass=self.mass)
        ball.pos, ball.ipos = self.position, np.zeros(3)  # MuJoCo's own ipos would be pos
        ball.inertia, ball.explicitinertial = np.full(3, 0.4 * self.mass * radius**2), True


def parse_load(text: str) -> dict[str, float]:
    """Read masses [kg] by names, written as NAME:KG,..."""
    items = [item.rpartition(":") for item in text.split(",")] if text else []
    try:
        load = {name: float(mass) for name, _, mass in items}
    except ValueError:
        load = {}
    if len(load) < len(items) or "" in load:
        raise ValueError(f"load is '{text}', expected NAME:KG,... with each name once")
    return load


def _rounded(value: str | float | Sequence[float]) -> str | float | list[float]:
    """Round numbers to five digits."""
    if isinstance(value, str):
        return value
    if isinstance(value, Sequence):
        return [float(f"{each:.5g}") for each in value]
    return float(f"{value:.5g}")


def make_explicit(spec: mujoco.MjSpec) -> None:
    """Write the masses and inertias that the compiler computes into the bodies."""
    spec.compiler.fusestatic = False
    spec.compiler.discardvisual = False
    model = spec.compile()
    for body in spec.bodies[1:]:
        i = body.id
        body.explicitinertial, body.fullinertia = True, np.full(6, np.nan)
        body.mass, body.ipos = float(model.body_mass[i]), model.body_ipos[i]
        body.inertia, body.iquat = model.body_inertia[i], model.body_iquat[i]
        body.ialt.type = mujoco.mjtOrientation.mjORIENTATION_QUAT
    spec.compiler.inertiafromgeom = mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_AUTO
    spec.compiler.settotalmass = -1.0
