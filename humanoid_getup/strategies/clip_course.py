"""Courses of clips: hands laid flat on the ground, and stored rises that lead on to the stand."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import mujoco
import numpy as np

from humanoid_getup.motions.course import Course
from humanoid_getup.motions.motion import Motion
from humanoid_getup.motions.posture_metric import PostureMetric
from humanoid_getup.simulation.world import World
from robots import Robot, quaternion
from robots.body.limbs import ARMS, Limbs
from robots.kinematics import lowest_points, place_postures
from robots.quaternion import Array
from robots.smooth_step import smooth_step

HAND_NEAR = 0.2, 0.15  # neck heights over the ground: hands are straight, and flat
EASE = 0.3  # s over which a hand turns
JOIN_PERIOD = 0.25  # s of the clip for each place at which a stored rise may be joined
JOIN_FROM = 0.5  # share of the clip before it: with less, it would be no rise of the clip's
BRIDGE = 0.4  # s from the clip to the stored rise
BEFORE_STAND = 0.8  # s before the stand of a stored rise within which it is not joined


@dataclass(frozen=True, kw_only=True, eq=False)
class Join:
    """A place of a clip from which a stored rise leads to the stand."""

    frame: int
    """Of the clip."""
    rise: Motion
    entry: int
    """Frame of the rise."""
    distance: float
    """Between the two, in the posture metric."""


def bend_hands(course: Course, world: World, rises: Sequence[Motion]) -> Course:
    """Bend the wrists while a hand is near the ground, as the robot's own rises do.

    Clips know nothing of hands, and a body that leans on its fingertips stands too high.
    """
    robot = world.robot
    limbs = Limbs(robot)
    joint_pos = course.joint_pos.copy()
    for name in ARMS:
        if name not in limbs.all:
            continue
        wrist = [k for k in limbs.all[name].joints if robot.joints[k].segment == "wrist"]
        if not wrist:
            continue
        flat = _find_flat(world, rises, wrist)
        if flat is None:
            continue
        far, near = (share * robot.standing_neck_height for share in HAND_NEAR)
        height = _measure_heights(course, world, wrist[-1])
        share = np.clip((far - height) / (far - near), 0.0, 1.0)
        width = max(round(EASE / robot.control_period), 1)
        padded = np.pad(share, (width // 2, width - 1 - width // 2), mode="edge")
        share = np.convolve(padded, np.full(width, 1.0 / width), "valid")
        joint_pos[:, wrist] = share[:, None] * flat
    bent = replace(course, joint_pos=joint_pos, joint_target=joint_pos)
    qpos = place_postures(robot, world.model, bent.position, bent.orientation, joint_pos)
    position = bent.position.copy()
    position[:, 2] -= lowest_points(world.model, qpos)
    return replace(bent, position=position)


def _measure_heights(course: Course | Motion, world: World, joint: int) -> Array:
    """Measure how high a joint of a robot is [m], (T,)."""
    robot, model = world.robot, world.model
    data, row = mujoco.MjData(model), model.joint(robot.joint_names[joint]).id
    qpos = place_postures(robot, model, course.position, course.orientation, course.joint_pos)
    height = np.zeros(len(qpos))
    for k, one in enumerate(qpos):
        data.qpos[:] = one
        mujoco.mj_kinematics(model, data)
        height[k] = data.xanchor[row, 2]
    return height


def _find_flat(world: World, rises: Sequence[Motion], wrist: list[int]) -> Array | None:
    """Find the wrist angles with which a robot's rises lean on a hand [rad]."""
    if not rises:
        return None
    near = HAND_NEAR[1] * world.robot.standing_neck_height
    rows = [
        rise.joint_target[_measure_heights(rise, world, wrist[-1]) < near][:, wrist]
        for rise in rises
    ]
    angles = np.concatenate(rows)
    return np.median(angles, axis=0) if len(angles) else None


def find_joins(course: Course, rises: Sequence[Motion], robot: Robot) -> list[Join]:
    """Find where stored rises are nearest to a course: the best in each part of its time."""
    metric, period = PostureMetric.of(robot), robot.control_period
    first = round(JOIN_FROM * len(course))
    step = max(round(0.04 / period), 1)
    rows = np.arange(first, len(course), step)
    parts = max(round((len(course) - first) * period / JOIN_PERIOD), 1)
    best = list[Join | None]([None] * parts)
    for rise in rises:
        until = rise.duration if rise.stand_time is None else rise.stand_time
        last = int(np.searchsorted(rise.time - rise.time[0], until - BEFORE_STAND))
        entries = np.arange(0, max(last, 1), step)
        distance = metric.distance(
            rise.orientation[entries, None],
            rise.joint_pos[entries, None],
            course.orientation[None, rows],
            course.joint_pos[None, rows],
        )  # (E, R)
        for part, columns in enumerate(np.array_split(np.arange(len(rows)), parts)):
            some = distance[:, columns]
            i, j = np.unravel_index(int(np.argmin(some)), some.shape)
            found, known = float(some[i, j]), best[part]
            if known is None or found < known.distance:
                best[part] = Join(
                    frame=int(rows[columns[j]]), rise=rise, entry=int(entries[i]), distance=found
                )
    return sorted((join for join in best if join), key=lambda join: join.distance)


def follow(course: Course, join: Join, robot: Robot) -> Course:
    """Continue a course by a stored rise, over a bridge."""
    period = robot.control_period
    before = course[: join.frame + 1]
    rise = join.rise
    at = np.arange(rise.time[join.entry], rise.time[-1] + 0.5 * period, period)
    frames = np.clip(np.searchsorted(rise.time, at - 1e-6), 0, len(rise.time) - 1)
    after = Course.aligned(rise, join.entry, before.end)[frames]
    count = round(BRIDGE / period)
    share = smooth_step(np.linspace(0.0, 1.0, count + 2)[1:-1])

    def mix(a: Array, b: Array) -> Array:
        return a + share[:, None] * (b - a)

    bridge = Course(
        position=mix(before.position[-1], after.position[0]),
        orientation=quaternion.slerp(
            np.tile(before.orientation[-1], (count, 1)),
            np.tile(after.orientation[0], (count, 1)),
            share,
        ),
        joint_pos=mix(before.joint_pos[-1], after.joint_pos[0]),
        joint_target=mix(before.joint_target[-1], after.joint_target[0]),
    )
    return before.then(bridge).then(after)
