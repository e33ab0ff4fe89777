"""Stance check: soles on the faces of the feet, balance, contacts, reserves of leg ranges."""

from __future__ import annotations

from collections.abc import Iterator

import mujoco
import numpy as np

from humanoid_getup.robot_check.finding import CheckFinding
from humanoid_getup.simulation.touch import find_touching_bodies
from humanoid_getup.simulation.world import World
from robots import Robot
from robots.body.limb import LEGS
from robots.body.limbs import Limbs
from robots.body.overlap import find_overlaps
from robots.body.soles import list_sole_points, measure_support_margin, measure_tilt
from robots.kinematics import place

NEAR = 0.002  # m; a site this near to the face is on it
LEVEL = np.radians(2.0)
LEAST_MARGIN = 0.01  # m from the center of mass to the edge of the soles
ROOM = np.radians(2.0)  # that a leg's joint needs on both sides to balance


def check_soles(robot: Robot) -> Iterator[CheckFinding]:
    """Find sole sites that are not on the lowest faces of the feet."""
    model = robot.spec().compile()
    found = [finding for site in robot.sole_sites for finding in _check_sole(model, site)]
    yield from found
    if not found:
        sites = " and ".join(f"'{site}'" for site in robot.sole_sites)
        yield CheckFinding.ok("soles", f"{sites} are on the faces of the feet")


def _check_sole(model: mujoco.MjModel, site: str) -> Iterator[CheckFinding]:
    subject, points = f"site '{site}'", list_sole_points(model, site)
    if not len(points):
        yield CheckFinding.fault(
            subject,
            "is on a foot without shapes, expected some to stand on",
            "give the foot a box or a capsule in the model",
        )
        return
    tilt, above = measure_tilt(points), -float(points[:, 2].min())
    if tilt > LEVEL:
        yield CheckFinding.fault(
            subject,
            f"is tilted by {np.degrees(tilt):.0f}° against the face of the foot",
            "turn it in the model until its z axis is normal to the face",
        )
    elif abs(above) > NEAR:
        where = "above" if above > 0.0 else "below"
        yield CheckFinding.warning(
            subject,
            f"is {1e3 * abs(above):.0f} mm {where} the lowest point of the foot",
            "put it on the face on which the foot stands",
        )


def check_stance(world: World, limbs: Limbs) -> Iterator[CheckFinding]:
    """Find problems of a robot's stance, without physics."""
    yield from _check_overlaps(limbs)
    yield from _check_ground(world)
    yield from _check_ranges(limbs)
    yield _check_balance(world)


def _check_overlaps(limbs: Limbs) -> Iterator[CheckFinding]:
    robot, model = limbs.robot, limbs.model
    for pair, depth in find_overlaps(model, place(robot, model, robot.standing)).items():
        a, b = (model.body(body).name or f"body {body}" for body in pair)
        yield CheckFinding.warning(
            "stance",
            f"{a} reaches {1e3 * depth:.0f} mm into {b}",
            "change [standing], make the shapes smaller, or exclude the pair in the model",
        )


def _check_ground(world: World) -> Iterator[CheckFinding]:
    robot = world.robot
    for body in find_touching_bodies(world, place(robot, world.model, robot.standing)):
        yield CheckFinding.fault(
            "stance",
            f"{body} touches the ground, expected the feet alone",
            "change [standing], or put the sole sites on the lowest faces",
        )


def _check_ranges(limbs: Limbs) -> Iterator[CheckFinding]:
    robot = limbs.robot
    angles = robot.standing.joint_pos
    room = np.minimum(angles - robot.lower, robot.upper - angles)
    for k in sorted(k for name in LEGS for k in limbs.all[name].joints if room[k] < ROOM):
        yield CheckFinding.warning(
            f"joint '{robot.joint_names[k]}'",
            f"stands {np.degrees(room[k]):.1f}° from the end of its range, expected at least "
            f"{np.degrees(ROOM):.0f}° to balance with",
            "bend it a little in [standing], or widen its range in the model",
        )


def _check_balance(world: World) -> CheckFinding:
    margin = measure_support_margin(world.robot, world.model)
    text = f"the center of mass is {1e3 * margin:.0f} mm inside the soles' edge"
    if margin >= LEAST_MARGIN:
        return CheckFinding.ok("stance", text)
    if margin < 0.0:
        text = f"the center of mass is {-1e3 * margin:.0f} mm outside the soles"
    if not np.isfinite(margin):
        text = "the soles have no area on the ground"
    return CheckFinding(
        level="fault" if margin < 0.0 else "warning",
        subject="stance",
        text=f"{text}, expected at least {1e3 * LEAST_MARGIN:.0f} mm inside",
        remedy="change hip and ankle pitch in [standing]",
    )
