"""The stance: is it balanced, free of contacts, and does it hold with the servos that it has?"""

from __future__ import annotations

from collections.abc import Iterator

import mujoco
import numpy as np
from scipy.spatial import ConvexHull, QhullError

from humanoid_getup.evaluation.standing import HOLD_TIME, is_upright, measure_stance
from humanoid_getup.robot_check.finding import Finding
from humanoid_getup.simulation.domain_parameters import DomainParameters
from humanoid_getup.simulation.rollout import Rollout
from humanoid_getup.simulation.touch import find_touching_bodies
from humanoid_getup.simulation.world import World
from robots.kinematics import place
from robots.model_import.contacts import find_overlaps
from robots.model_import.shapes import read_shapes
from robots.quaternion import Array

LEAST_MARGIN = 0.01  # m from the center of mass to the edge of the soles
STRAINED = 0.5  # share of a servo's stall torque that a stance may take
ON_GROUND = 0.004  # m above the lowest point that still belong to a sole


def check_stance(world: World) -> Iterator[Finding]:
    """Find what is wrong with a robot's stance."""
    yield from _check_overlaps(world)
    yield _check_balance(world)
    yield from _check_hold(world)


def _check_overlaps(world: World) -> Iterator[Finding]:
    model, robot = world.model, world.robot
    alone = robot.spec().compile()
    layout = robot.layout(alone)
    angles = alone.qpos0[7:].copy()
    angles[layout.qpos - 7] = robot.standing.joint_pos
    for (a, b), depth in find_overlaps(alone, angles).items():
        yield Finding(
            level="warning",
            subject="stance",
            text=f"{model.body(alone.body(a).name).name} reaches {1e3 * depth:.0f} mm into "
            f"{alone.body(b).name}",
            remedy="change [standing], make the shapes smaller, or exclude the pair in the model",
        )


def _check_balance(world: World) -> Finding:
    margin = measure_margin(world)
    text = f"the center of mass is {1e3 * margin:.0f} mm inside the soles' edge"
    if margin >= LEAST_MARGIN:
        return Finding(level="ok", subject="stance", text=text)
    if margin < 0.0:
        text = f"the center of mass is {-1e3 * margin:.0f} mm outside the soles"
    return Finding(
        level="fault" if margin < 0.0 else "warning",
        subject="stance",
        text=f"{text}, expected at least {1e3 * LEAST_MARGIN:.0f} mm inside",
        remedy="change hip and ankle pitch in [standing]",
    )


def measure_margin(world: World) -> float:
    """Measure how far the center of mass is inside the edge of the soles on the ground [m]."""
    robot, model = world.robot, world.model
    data = mujoco.MjData(model)
    data.qpos[:] = place(robot, model, robot.standing)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    center = data.subtree_com[robot.layout(model).torso][:2]
    points = np.concatenate([_list_sole_points(model, data, site) for site in robot.sole_sites])
    points = points[points[:, 2] < points[:, 2].min() + ON_GROUND][:, :2]
    try:
        edges = ConvexHull(points).equations  # outward normals and offsets
    except QhullError:
        return -np.inf
    return float(-np.max(edges[:, :2] @ center + edges[:, 2]))


def _list_sole_points(model: mujoco.MjModel, data: mujoco.MjData, site: str) -> Array:
    body = int(model.site_bodyid[model.site(site).id])
    own = np.concatenate([shape.sample() for shape in read_shapes(model, body, keep_hulls=True)])
    return data.xpos[body] + own @ data.xmat[body].reshape(3, 3).T


def _check_hold(world: World) -> Iterator[Finding]:
    """Let the robot stand on its servos for a while."""
    robot = world.robot
    count = round((HOLD_TIME + 1.0) / robot.control_period)
    targets = np.tile(robot.standing.joint_pos, (1, count, 1))
    start = place(robot, world.model, robot.standing)[None]
    trace = Rollout(world, 1).play(start, targets, DomainParameters.nominal(world, 1))
    stance = measure_stance(world, trace)
    if not is_upright(stance, robot)[0].all():
        bodies = ", ".join(find_touching_bodies(world, trace.qpos[0, -1]))
        on = f", on the ground: {bodies}" if bodies else ""
        lost = float(stance.neck_height[0, -1] / robot.standing_neck_height)
        tilt = float(np.degrees(stance.tilt[0, -1]))
        yield Finding(
            level="fault",
            subject="stance",
            text=f"does not hold for {HOLD_TIME:g} s on its servos: neck at {lost:.0%} of its "
            f"height, tilted by {tilt:.0f}°{on}",
            remedy="change [standing], or the servos if a joint below is too weak",
        )
        return
    share = np.abs(trace.torque[0, -1]) / robot.max_torque
    worst = int(np.argmax(share))
    yield Finding(
        level="ok" if share[worst] < STRAINED else "warning",
        subject="stance",
        text=f"holds on its servos; the most strained joint is '{robot.joint_names[worst]}' with "
        f"{share[worst]:.0%} of its stall torque",
        remedy="" if share[worst] < STRAINED else "straighten the knees in [standing]",
    )
