"""Servos on a bench: a robot that is nothing but its servos, on a plate that does not move."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np

from robots.bus_settings import MAIN_PORT, WATCHDOG, BusSettings
from robots.posture import Posture
from robots.robot import Joint, Robot
from robots.servo import Servo, ServoModel

FOLDER = Path("bench")
"""Folder of a bench that is in none."""
IMU_SITE = "imu"

# The plate is so heavy that servos on it do not move it.
PLATE_MASS, PLATE_HEIGHT, PLATE_DEPTH = 100.0, 0.05, 0.2  # kg, m, m
SPACING, HORN_HEIGHT = 0.1, 0.3  # m between two servos; m of their horns over the plate
HORN_MASS, HORN_RADIUS = 0.01, 0.01  # kg, m
MAX_MASS, MAX_ARM = 20.0, 2.0  # kg, m, of a load

# A cycle's bytes may take this share of its period, and a period is at least as long as this.
WIRE_SHARE, LEAST_PERIOD, PERIOD_STEP = 0.6, 0.01, 0.002
WATCHDOG_CYCLES = 5  # without a command after which the servos stop
SERVO_BITS, CYCLE_BITS = 300, 1000  # on the wire in a cycle: for each servo, and once


@dataclass(frozen=True, kw_only=True)
class Load:
    """A mass on a lever, which hangs down from the horn at angle 0."""

    mass: float = 0.0
    """[kg]; 0 for a bare horn."""
    arm: float = 0.1
    """Distance from the horn [m]."""

    @classmethod
    def parse(cls, text: str) -> Load:
        """Read a load written as KG:M."""
        try:
            mass, arm = map(float, text.split(":"))
        except ValueError:
            mass, arm = math.nan, math.nan
        if not (0.0 <= mass <= MAX_MASS and 0.0 < arm <= MAX_ARM):
            raise ValueError(
                f"--load is '{text}', expected KG:M, a mass of 0 to {MAX_MASS:g} kg and its "
                f"distance from the horn, up to {MAX_ARM:g} m, such as 0.2:0.1"
            )
        return cls(mass=mass, arm=arm)


BARE = Load()


@dataclass(frozen=True, kw_only=True, repr=False)
class ServoBench(Robot):
    """Servos side by side on a heavy plate, each with its load.

    It has joints, servos and a bus as any robot, so that whatever needs no body works with it:
    virtual bus, diagnosis, calibration, guarded motion. Its stance is that of the plate.
    """

    loads: tuple[Load, ...] = ()
    """Load of each servo."""

    def read_model(self) -> mujoco.MjSpec:
        """Build the plate with a hinge for each servo."""
        return build_bench_model(self.joints, self.loads)


def build_bench_model(joints: Sequence[Joint], loads: Sequence[Load]) -> mujoco.MjSpec:
    """Build a plate with a hinge and a load for each joint, x forward, hinges about y."""
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    half_width = 0.5 * SPACING * (len(joints) + 1)
    plate = spec.worldbody.add_body(name="plate")
    plate.add_freejoint()
    plate.add_geom(
        type=mujoco.mjtGeom.mjGEOM_BOX,
        size=[0.5 * PLATE_DEPTH, half_width, 0.5 * PLATE_HEIGHT],
        pos=[0.0, 0.0, 0.5 * PLATE_HEIGHT],
        mass=PLATE_MASS,
    )
    for name, height in (("top", HORN_HEIGHT), (IMU_SITE, PLATE_HEIGHT), ("underside", 0.0)):
        plate.add_site(name=name, pos=[0.0, 0.0, height])
    for i, (joint, load) in enumerate(zip(joints, loads, strict=True)):
        place = [0.0, half_width - SPACING * (i + 1), PLATE_HEIGHT + HORN_HEIGHT]
        horn = plate.add_body(name=f"horn {joint.name}", pos=place)
        horn.add_joint(
            name=joint.name,
            type=mujoco.mjtJoint.mjJNT_HINGE,
            axis=[0.0, 1.0, 0.0],
            range=[joint.lower, joint.upper],
            limited=True,
        )
        _add_weight(horn, HORN_MASS, 0.0)
        if load.mass:
            _add_weight(horn, load.mass, load.arm)
    return spec


def make_bench(
    servos: Sequence[Joint],
    *,
    baud: int,
    loads: Sequence[Load] | None = None,
    control_period: float | None = None,
) -> ServoBench:
    """Make a bench of servos on one port, at the nominal supply of the first.

    Args:
        servos: The servos as joints, with their ranges; see `make_bench_joint`.
        baud: Baud rate [bit/s].
        loads: Load of each servo; None for bare horns.
        control_period: [s]; None for one that suits the baud rate.
    """
    period = choose_period(len(servos), baud) if control_period is None else control_period
    ports = {MAIN_PORT: tuple(joint.name for joint in servos)}
    watchdog = max(WATCHDOG, WATCHDOG_CYCLES * period)
    senses_current = all(joint.servo.model.has_current_mode for joint in servos)
    return ServoBench(
        name="bench",
        folder=FOLDER,
        joints=tuple(servos),
        loads=tuple(loads or (BARE for _ in servos)),
        torso="plate",
        neck_site="top",
        imu_site=None,
        sole_sites=("underside",),
        control_period=period,
        supply_voltage=servos[0].servo.model.nominal_voltage,
        standing=Posture(
            position=np.zeros(3),
            orientation=np.array([1.0, 0.0, 0.0, 0.0]),
            joint_pos=np.array([min(max(0.0, j.lower), j.upper) for j in servos]),
        ),
        standing_neck_height=HORN_HEIGHT,
        mirror_index=np.arange(len(servos)),
        mirror_sign=np.ones(len(servos)),
        model_file=FOLDER / "none",  # its model is built
        bus=BusSettings(baud=baud, watchdog=watchdog, ports=ports),
        limit_by="current" if senses_current else "pwm",
    )


def make_bench_joint(
    model: ServoModel,
    servo_id: int,
    *,
    name: str = "",
    lower: float | None = None,
    upper: float | None = None,
    keeps_limits: bool = False,
) -> Joint:
    """Make a joint of a servo on a bench, angle 0 in the middle of its turn; ranges in rad.

    A range that is not given is that of the servo's positions.
    """
    middle = model.middle_tick
    servo = Servo(id=servo_id, model=model, sign=1, zero_ticks=middle, keeps_limits=keeps_limits)
    name = name or f"servo_{servo_id}"
    lowest, highest = model.ends
    lower = lowest if lower is None else lower
    upper = highest if upper is None else upper
    return Joint(name=name, lower=lower, upper=upper, servo=servo, segment="other")


def choose_period(servos: int, baud: int, latency: float = 0.0, reads: int = 2) -> float:
    """Choose a control period [s] that leaves time beside a cycle's bytes at a baud rate.

    ``latency`` is how long the adapter holds back a reply [s]; a cycle waits for it in each read.
    """
    wire = (CYCLE_BITS + servos * SERVO_BITS) / baud
    steps = math.ceil(max(LEAST_PERIOD, (wire + reads * latency) / WIRE_SHARE) / PERIOD_STEP)
    return round(steps * PERIOD_STEP, 6)


def _add_weight(horn: mujoco.MjsBody, mass: float, arm: float) -> None:
    horn.add_geom(
        type=mujoco.mjtGeom.mjGEOM_SPHERE,
        size=[HORN_RADIUS, 0.0, 0.0],
        pos=[0.0, 0.0, -arm],
        mass=mass,
        contype=0,
        conaffinity=0,
    )
