"""Courses: paths, rests and motions one after the other, without a jump in angles or targets."""

import numpy as np
import pytest

from humanoid_getup.motions.course import Course
from humanoid_getup.motions.motion import Motion, Trajectory
from humanoid_getup.motions.motion_database import find_motion
from robots import Robot


@pytest.fixture(scope="module")
def motion(op3: Robot) -> Motion:
    return find_motion(op3, "squat_to_stand")


@pytest.fixture
def path(op3: Robot, motion: Motion) -> Trajectory:
    """From the first posture of the motion, every joint by 0.1 rad in 0.2 s."""
    share = np.linspace(0.0, 1.0, 26)[:, None]
    posture = motion.posture(0)
    return Trajectory(
        time=op3.control_period * np.arange(26),
        position=np.tile(posture.position, (26, 1)),
        orientation=np.tile(posture.orientation, (26, 1)),
        joint_pos=posture.joint_pos + 0.1 * share,
    )


def test_a_course_that_plays_a_whole_motion_is_that_motion(op3: Robot, motion: Motion):
    course = Course.at(motion.posture(0)).play(motion, 0, None, op3.control_period)
    made = course.to_motion(motion, op3.control_period, name="again")
    assert (made.name, made.strategy) == ("again", motion.strategy)
    np.testing.assert_allclose(made.joint_pos, motion.joint_pos, atol=1e-9)
    np.testing.assert_allclose(made.position, motion.position, atol=1e-9)
    np.testing.assert_allclose(made.joint_target[-1], motion.joint_target[-1])


def test_a_rest_keeps_posture_and_load(op3: Robot, motion: Motion):
    before = Course.at(motion.posture(0)).play(motion, 0, 60, op3.control_period)
    assert np.abs(before.load).max() > 0.01
    rested = before.rest(0.2, op3.control_period)
    assert len(rested) == len(before) + round(0.2 / op3.control_period)
    for rows in (rested.joint_pos, rested.joint_target):
        np.testing.assert_allclose(rows[len(before) :], rows[[len(before) - 1]].repeat(25, axis=0))


def test_a_path_that_is_followed_leads_by_the_lag_and_by_the_load(op3: Robot, path: Trajectory):
    loaded = Course.of(path, path.joint_pos + 0.05)[:1]
    followed = loaded.follow(path, op3)
    assert len(followed) == len(path.time)
    np.testing.assert_array_equal(followed.joint_pos, path.joint_pos)
    lead = followed.joint_target[1:] - path.joint_pos[1:]
    lag = op3.compute_lag(np.full(op3.n, 0.1 / 0.2))
    np.testing.assert_allclose(lead, np.tile(0.05 + lag, (25, 1)))
