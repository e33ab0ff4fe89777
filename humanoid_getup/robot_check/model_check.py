"""Findings of a robot check, and those of the model: masses, sites and mirror pairs."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import mujoco
import numpy as np

from robots import Robot
from robots.body.limbs import ARMS, LEGS, Limbs
from robots.body.sides import MirrorImages
from robots.quaternion import Array

Level = Literal["fault", "warning", "ok"]


@dataclass(frozen=True, kw_only=True)
class CheckFinding:
    """One result of a check, in a line."""

    level: Level
    """"fault": the robot cannot get up as described. "warning": it may fail. "ok": a figure."""
    subject: str
    """Subject, such as "stance" or "joint 'l_knee'"."""
    text: str
    remedy: str = ""
    """What to do; empty if there is nothing to be done."""

    @classmethod
    def ok(cls, subject: str, text: str, remedy: str = "") -> CheckFinding:
        """Make a finding without a problem."""
        return cls(level="ok", subject=subject, text=text, remedy=remedy)

    @classmethod
    def warning(cls, subject: str, text: str, remedy: str) -> CheckFinding:
        """Make a finding that may keep the robot from getting up."""
        return cls(level="warning", subject=subject, text=text, remedy=remedy)

    @classmethod
    def fault(cls, subject: str, text: str, remedy: str) -> CheckFinding:
        """Make a finding that keeps the robot from getting up."""
        return cls(level="fault", subject=subject, text=text, remedy=remedy)

    def __str__(self) -> str:
        """Write the finding in one line."""
        remedy = f" ({self.remedy})" if self.remedy else ""
        return f"{self.subject}: {self.text}{remedy}"


DENSITY = (5.0, 300.0)
"""Mass over the neck height cubed [kg/m³]; OP3 has 46, a person of 70 kg about 25."""
LIGHTEST = 1e-4  # share of the robot's mass; a lighter link was given none
WIDEST = 0.5  # radius of gyration of a link over the neck height; placeholders are wider
FLOATING = 0.1  # of the neck height, by which a shape is not part of what is around it
FARTHEST_IMU = 0.5  # from the torso's center of mass, over the neck height
CLEAR = 0.5  # cosine from which an axis is said to turn one way or the other
FAR = 0.15  # share of the neck height by which a joint may be off its mirror image's place
UNEQUAL = np.radians(5.0)
FULL_TURN = 2.0 * np.pi - 1e-3  # rad; shoulders may turn so far, legs do not


def check_body(limbs: Limbs) -> Iterator[CheckFinding]:
    """Find implausible masses, inertias and sites."""
    found = [*_check_mass(limbs), *_check_links(limbs), *_check_shapes(limbs)]
    found += [*_check_imu(limbs), *_check_neck(limbs)]
    yield from found
    if not found:
        height = limbs.robot.standing_neck_height
        text = f"{limbs.robot.n} joints, {limbs.mass:.2f} kg, neck at {height:.2f} m"
        yield CheckFinding.ok("body", text)


def _check_mass(limbs: Limbs) -> Iterator[CheckFinding]:
    robot, mass = limbs.robot, limbs.mass
    servos = sum(joint.servo.model.mass for joint in robot.joints)
    least, most = (density * robot.standing_neck_height**3 for density in DENSITY)
    if mass < servos:
        yield CheckFinding.warning(
            "body",
            f"weighs {mass:.2f} kg, less than its {robot.n} servos, {servos:.2f} kg",
            "give the bodies in the model their masses",
        )
    elif not least <= mass <= most:
        yield CheckFinding.warning(
            "body",
            f"weighs {mass:.3g} kg with its neck at {robot.standing_neck_height:.2f} m, "
            f"expected {least:.2g} to {most:.2g} kg",
            "check the units of lengths and masses in the model",
        )


def _check_links(limbs: Limbs) -> Iterator[CheckFinding]:
    """Compare mass and inertia of each moving link; what is welded to it is part of it."""
    model, height = limbs.model, limbs.robot.standing_neck_height
    least, widest = LIGHTEST * limbs.mass, WIDEST * height
    light, wide = list[str](), list[str]()
    for link in np.setdiff1d(model.body_weldid, [0]):
        bodies = np.flatnonzero(model.body_weldid == link)
        mass, name = float(model.body_mass[bodies].sum()), _name(model, int(link))
        radius = max(_measure_gyration(model, int(body)) for body in bodies)
        if mass < least:
            light.append(f"{name} ({1e3 * mass:.2g} g)")
        elif radius > widest:
            wide.append(f"{name} ({radius:.2f} m)")
    if light:
        yield CheckFinding.warning(
            "masses",
            f"below {1e3 * least:.2g} g: {', '.join(light)}",
            "give links their mass, or weld them to their parents",
        )
    if wide:
        yield CheckFinding.warning(
            "inertias",
            f"radius of gyration above {widest:.2f} m: {', '.join(wide)}",
            "give links their own inertias: these look like placeholders",
        )


def _measure_gyration(model: mujoco.MjModel, body: int) -> float:
    mass = float(model.body_mass[body])
    return float(np.sqrt(model.body_inertia[body].max() / mass)) if mass > 0.0 else 0.0


def _check_shapes(limbs: Limbs) -> Iterator[CheckFinding]:
    """Find shapes that are far from all others, and from the joints of their links."""
    model, most = limbs.model, FLOATING * limbs.robot.standing_neck_height
    limbs.look(limbs.robot.standing.joint_pos)
    for geom in range(model.ngeom):
        away = min(_measure_gaps(limbs, geom, most), default=most)
        if away >= most:
            name = model.geom(geom).name or f"number {geom}"
            yield CheckFinding.warning(
                f"shape '{name}'",
                f"of body '{_name(model, int(model.geom_bodyid[geom]))}' is more than "
                f"{1e3 * most:.0f} mm from all others, and from its joints",
                "remove it from the model if it is no part of the robot",
            )


def _measure_gaps(limbs: Limbs, geom: int, most: float) -> Iterator[float]:
    """Measure the gaps, up to a most, from a shape to joints of its link, and all others [m]."""
    model, data = limbs.model, limbs.data
    link = model.body_weldid[model.geom_bodyid[geom]]
    moved = model.jnt_bodyid
    own = (moved == link) | (model.body_weldid[model.body_parentid[moved]] == link)
    own &= model.jnt_type != mujoco.mjtJoint.mjJNT_FREE
    ways = data.xanchor[own] - data.geom_xpos[geom]
    yield from np.linalg.norm(ways, axis=1) - model.geom_rbound[geom]
    for other in range(model.ngeom):
        if other != geom:
            yield mujoco.mj_geomDistance(model, data, geom, other, most, None)


def _check_imu(limbs: Limbs) -> Iterator[CheckFinding]:
    robot, model = limbs.robot, limbs.model
    if robot.imu_site is None:
        return
    site, torso = model.site(robot.imu_site), model.body(robot.torso).id
    subject = f"site '{robot.imu_site}'"
    away = float(np.linalg.norm(site.pos - model.body_ipos[torso]))
    most = FARTHEST_IMU * robot.standing_neck_height
    if int(site.bodyid[0]) != torso:
        yield CheckFinding.fault(
            subject,
            f"is on body '{_name(model, int(site.bodyid[0]))}', expected '{robot.torso}'",
            "put the IMU's site into the torso's body in the model",
        )
    elif away > most:
        yield CheckFinding.warning(
            subject,
            f"is {away:.2f} m from the torso's center of mass, expected at most {most:.2f} m",
            "put it where the IMU is",
        )


def _check_neck(limbs: Limbs) -> Iterator[CheckFinding]:
    robot = limbs.robot
    limbs.look(robot.standing.joint_pos)
    shoulders = [limbs.anchor(limbs.all[a].joints[0])[2] for a in ARMS if a in limbs.all]
    neck = limbs.data.site_xpos[limbs.model.site(robot.neck_site).id, 2]
    below = max(shoulders, default=neck) - neck
    if below > 0.0:
        yield CheckFinding.warning(
            f"site '{robot.neck_site}'",
            f"is {1e3 * below:.0f} mm below the shoulders, expected above them",
            "put it at the neck's base: its height tells whether the robot stands",
        )


def _name(model: mujoco.MjModel, body: int) -> str:
    return model.body(body).name or f"number {body}"


def check_turns(limbs: Limbs) -> Iterator[CheckFinding]:
    """Find joints whose range is a full turn, as an import gives those without range."""
    robot = limbs.robot
    turning = np.flatnonzero(robot.upper - robot.lower >= FULL_TURN)
    legs = {k for name in LEGS for k in limbs.all[name].joints}
    if len(turning):
        yield CheckFinding(
            level="ok" if legs.isdisjoint(turning.tolist()) else "warning",
            subject="ranges",
            text=f"a full turn is that of {', '.join(robot.joint_names[k] for k in turning)}",
            remedy="give joints that cannot turn so far their ranges in the model",
        )


def check_mirrors(limbs: Limbs) -> Iterator[CheckFinding]:
    """Find pairs of joints that do not mirror each other.

    They are looked at with all joints at zero: whatever their signs, that is its own mirror image.
    """
    robot = limbs.robot
    limbs.look(np.zeros(robot.n))
    anchors = np.array([limbs.anchor(k) for k in range(robot.n)])
    axes = np.array([limbs.axis(k) for k in range(robot.n)])
    found = [*_compare(robot, MirrorImages.compare(anchors, axes))]
    yield from found
    if not found:
        pairs = int(np.sum(robot.mirror_index != np.arange(robot.n))) // 2
        yield CheckFinding.ok("mirror", f"{pairs} pairs and their signs agree with the model")


def _compare(robot: Robot, images: MirrorImages) -> Iterator[CheckFinding]:
    is_near = images.apart < FAR * robot.standing_neck_height
    is_image = is_near & (np.abs(images.along) > CLEAR)
    for k in range(robot.n):
        other = int(robot.mirror_index[k])
        sign = np.sign(images.along[k, other])
        if other < k:
            continue
        if not is_image[k, other]:
            yield _describe_stranger(robot, k, is_image[k], images.apart[k])
        elif sign != robot.mirror_sign[k]:
            yield CheckFinding.fault(
                f"joint '{robot.joint_names[k]}'",
                f"mirror_sign is {robot.mirror_sign[k]:+.0f}, but its axis says "
                f"{sign:+.0f} for its mirror {_partner(robot, k)}",
                "set mirror_sign of both in robot.toml",
            )
        else:
            yield from _compare_ranges(robot, k, other)


def _partner(robot: Robot, k: int) -> str:
    other = int(robot.mirror_index[k])
    return "itself" if other == k else f"'{robot.joint_names[other]}'"


def _describe_stranger(robot: Robot, k: int, is_image: np.ndarray, apart: Array) -> CheckFinding:
    """Describe a joint whose mirror has another place or axis, and the joint that fits."""
    subject, candidates = f"joint '{robot.joint_names[k]}'", np.flatnonzero(is_image)
    text = f"its mirror is {_partner(robot, k)}, which is not its mirror image in the model"
    if not len(candidates):
        return CheckFinding.warning(
            subject,
            f"{text}; no joint is",
            "mirrored motions differ by it: accept that, or make the model symmetric",
        )
    fitting = robot.joint_names[int(candidates[np.argmin(apart[candidates])])]
    return CheckFinding.fault(
        subject, f"{text}; '{fitting}' is", "set mirror of all that are concerned in robot.toml"
    )


def _compare_ranges(robot: Robot, k: int, other: int) -> Iterator[CheckFinding]:
    sign = robot.mirror_sign[k]
    expected = np.sort(sign * np.array([robot.lower[k], robot.upper[k]]))
    if k != other and np.abs(expected - [robot.lower[other], robot.upper[other]]).max() > UNEQUAL:
        low, high = np.degrees([robot.lower[other], robot.upper[other]])
        yield CheckFinding.warning(
            f"joint '{robot.joint_names[other]}'",
            f"its range is {low:.0f} to {high:.0f}°, that of its mirror "
            f"'{robot.joint_names[k]}' would be {np.degrees(expected[0]):.0f} to "
            f"{np.degrees(expected[1]):.0f}°",
            "set the same range on both sides in the model, or nothing if they differ",
        )
