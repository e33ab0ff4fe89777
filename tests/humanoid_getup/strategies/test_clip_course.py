"""Courses of clips: limbs that reach into a thicker body go round it."""

from __future__ import annotations

import mujoco
import numpy as np

from humanoid_getup.motions.course import Course
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.clip_course import CLEAR, separate_limbs
from robots import Robot
from robots.body.overlap import overlaps_at
from robots.kinematics import place_postures

FRAMES, INSIDE = 240, slice(100, 140)


def measure(course: Course, world: World) -> np.ndarray:
    data = mujoco.MjData(world.model)
    qpos = place_postures(
        world.robot, world.model, course.position, course.orientation, course.joint_pos
    )
    return np.array([overlaps_at(world.model, row, data).max() for row in qpos])


def test_an_arm_inside_the_body_goes_round_it_and_nothing_else_moves(world: World, op3: Robot):
    standing = op3.standing
    joint_pos = np.tile(standing.joint_pos, (FRAMES, 1))
    arm = [op3.joint_names.index(name) for name in ("l_sho_pitch", "l_sho_roll", "l_el")]
    joint_pos[INSIDE, arm] = 0.5, 1.0, -2.4
    course = Course(
        position=np.tile(standing.position, (FRAMES, 1)),
        orientation=np.tile(standing.orientation, (FRAMES, 1)),
        joint_pos=joint_pos,
        joint_target=joint_pos,
    )
    assert measure(course, world)[INSIDE].min() > 0.01
    parted = separate_limbs(course, world)
    assert measure(parted, world).max() < CLEAR
    np.testing.assert_array_equal(parted.joint_target, parted.joint_pos)
    others = np.setdiff1d(np.arange(op3.n), arm)
    np.testing.assert_array_equal(parted.joint_pos[:, others], joint_pos[:, others])
    np.testing.assert_array_equal(parted.joint_pos[: INSIDE.start], joint_pos[: INSIDE.start])
