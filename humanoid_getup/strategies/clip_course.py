"""Courses of clips: hands laid flat on the ground, and stored rises that lead on to the stand."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import mujoco
import numpy as np

from humanoid_getup.filtering.separation import Separation
from humanoid_getup.motions.course import Course
from humanoid_getup.motions.motion import Motion
from humanoid_getup.motions.posture_metric import PostureMetric
from humanoid_getup.simulation.world import World
from robots import Robot, quaternion
from robots.body.limbs import ARMS, Limbs
from robots.body.overlap import overlaps_at
from robots.kinematics import lowest_points, place_postures
from robots.quaternion import Array
from robots.smooth_step import smooth_step

HAND_NEAR = 0.2, 0.15  # neck heights over the ground: hands are straight, and flat
EASE = 0.3  # s over which a hand turns
SHALLOW = 0.02  # m inside itself up to which a clip is left to the tracker, which avoids it
DEEP, CLEAR = 0.008, 0.002  # m of an arm, and of any body, that stay inside another
SEPARATIONS = 8  # times that limbs are moved apart, at most
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


def separate_limbs(course: Course, world: World) -> Course:
    """Separate limbs that overlap the body, as those of a clip of a thinner person do.

    An arm that is deep inside takes the postures between the nearest ones in which it is not; what
    is left is moved along the gradients of the distances.
    """
    robot, limbs, separation = world.robot, Limbs(world.robot), Separation(world)
    joint_pos, rows = course.joint_pos.copy(), np.arange(len(course))
    arms = [limbs.all[name] for name in ARMS if name in limbs.all]
    depth = _measure_depths(course, world, joint_pos)
    if depth.max() < SHALLOW:
        return course
    for arm in arms:
        inside = depth[:, _list_bodies(world, arm.joints[0])].max(axis=1) > DEEP
        if inside.any() and not inside.all():
            for k in arm.joints:
                joint_pos[:, k] = np.interp(rows, rows[~inside], joint_pos[~inside, k])
    for _ in range(SEPARATIONS):
        deepest = _measure_depths(course, world, joint_pos).max(axis=1)
        if deepest.max() < CLEAR:
            break
        qpos = place_postures(robot, world.model, course.position, course.orientation, joint_pos)
        _, alone = separation.shift(qpos, deepest, len(course), CLEAR)[:2]
        joint_pos = np.clip(joint_pos + alone, robot.lower, robot.upper)
    return replace(course, joint_pos=joint_pos, joint_target=joint_pos)


def _measure_depths(course: Course, world: World, joint_pos: Array) -> Array:
    """Measure how deep each body is in others of the robot [m], (T, nbody)."""
    model, data = world.model, mujoco.MjData(world.model)
    qpos = place_postures(world.robot, model, course.position, course.orientation, joint_pos)
    pairs = np.array([overlaps_at(model, row, data) for row in qpos])
    return np.maximum(pairs.max(axis=1), pairs.max(axis=2))


def _list_bodies(world: World, joint: int) -> list[int]:
    """List the bodies that a joint moves."""
    model = world.model
    moved = [int(model.joint(world.robot.joint_names[joint]).bodyid[0])]
    for body in range(moved[0] + 1, model.nbody):
        if int(model.body_parentid[body]) in moved:
            moved.append(body)
    return moved


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
