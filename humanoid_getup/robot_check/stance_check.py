"""The stance: is it balanced, free of contacts, and within the ranges of the legs?"""

from __future__ import annotations

from collections.abc import Iterator

import mujoco
import numpy as np
from scipy.spatial import ConvexHull, QhullError

from humanoid_getup.robot_check.finding import Finding
from humanoid_getup.robot_check.sole_check import list_sole_points
from humanoid_getup.simulation.touch import find_touching_bodies
from humanoid_getup.simulation.world import World
from robots.body.limb import LEGS
from robots.body.limbs import Limbs
from robots.body.overlap import find_overlaps
from robots.kinematics import place
from robots.quaternion import Array

LEAST_MARGIN = 0.01  # m from the center of mass to the edge of the soles
ON_GROUND = 0.004  # m above the lowest point that still belong to a sole
ROOM = np.radians(2.0)  # that a leg's joint needs on both sides to balance


def check_stance(world: World, limbs: Limbs) -> Iterator[Finding]:
    """Find what is wrong with a robot's stance, before any physics."""
    yield from _check_overlaps(limbs)
    yield from _check_ground(world)
    yield from _check_ranges(limbs)
    yield _check_balance(world)


def _check_overlaps(limbs: Limbs) -> Iterator[Finding]:
    robot, model = limbs.robot, limbs.model
    for pair, depth in find_overlaps(model, place(robot, model, robot.standing)).items():
        a, b = (model.body(body).name or f"body {body}" for body in pair)
        yield Finding(
            level="warning",
            subject="stance",
            text=f"{a} reaches {1e3 * depth:.0f} mm into {b}",
            remedy="change [standing], make the shapes smaller, or exclude the pair in the model",
        )


def _check_ground(world: World) -> Iterator[Finding]:
    robot = world.robot
    for body in find_touching_bodies(world, place(robot, world.model, robot.standing)):
        yield Finding(
            level="fault",
            subject="stance",
            text=f"{body} touches the ground, expected the feet alone",
            remedy="change [standing], or put the sole sites on the lowest faces",
        )


def _check_ranges(limbs: Limbs) -> Iterator[Finding]:
    robot = limbs.robot
    angles = robot.standing.joint_pos
    room = np.minimum(angles - robot.lower, robot.upper - angles)
    for k in sorted(k for name in LEGS for k in limbs.all[name].joints if room[k] < ROOM):
        yield Finding(
            level="warning",
            subject=f"joint '{robot.joint_names[k]}'",
            text=f"stands {np.degrees(room[k]):.1f}° from the end of its range, expected at least "
            f"{np.degrees(ROOM):.0f}° to balance with",
            remedy="bend it a little in [standing], or widen its range in the model",
        )


def _check_balance(world: World) -> Finding:
    margin = measure_margin(world)
    text = f"the center of mass is {1e3 * margin:.0f} mm inside the soles' edge"
    if margin >= LEAST_MARGIN:
        return Finding(level="ok", subject="stance", text=text)
    if margin < 0.0:
        text = f"the center of mass is {-1e3 * margin:.0f} mm outside the soles"
    if not np.isfinite(margin):
        text = "the soles have no area on the ground"
    return Finding(
        level="fault" if margin < 0.0 else "warning",
        subject="stance",
        text=f"{text}, expected at least {1e3 * LEAST_MARGIN:.0f} mm inside",
        remedy="change hip and ankle pitch in [standing]",
    )


def measure_margin(world: World) -> float:
    """Measure how far the center of mass is inside the edge of the soles on the ground [m].

    It is negative outside, and minus infinity for soles without area.
    """
    robot, model = world.robot, world.model
    data = mujoco.MjData(model)
    data.qpos[:] = place(robot, model, robot.standing)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    center = data.subtree_com[robot.layout(model).torso][:2]
    points = np.concatenate([_place_sole(model, data, site) for site in robot.sole_sites])
    points = points[points[:, 2] < points[:, 2].min() + ON_GROUND][:, :2]
    try:
        edges = ConvexHull(points).equations  # outward normals and offsets
    except QhullError:
        return -np.inf
    return float(-np.max(edges[:, :2] @ center + edges[:, 2]))


def _place_sole(model: mujoco.MjModel, data: mujoco.MjData, site: str) -> Array:
    """Return the points that span a foot in the world [m], (p, 3)."""
    number = model.site(site).id
    axes = data.site_xmat[number].reshape(3, 3)
    return data.site_xpos[number] + list_sole_points(model, site) @ axes.T
