"""Many robots on style curves, and the errors of one."""

import numpy as np
import pytest

from humanoid_getup.policy.observation import Sensed
from humanoid_getup.policy.style_follower import StyleFollower
from humanoid_getup.style.style import Style
from humanoid_getup.style.style_file import load_style
from robots import Robot

STEP = 0.048  # s
SUPINE, PRONE = np.array([-1.0, 0.0, 0.0]), np.array([1.0, 0.0, 0.0])


def lie(robot: Robot, gravity: np.ndarray) -> Sensed:
    still = np.zeros(robot.n)
    return Sensed(
        gravity=gravity, gyro=np.zeros(3), joint_pos=robot.standing.joint_pos, joint_vel=still
    )


def follow(robot: Robot, style: Style) -> StyleFollower:
    return StyleFollower(robot, lambda _, seen: style.choose(seen))


def test_each_of_many_robots_follows_as_it_would_alone(op3: Robot):
    """One lies on its back, one on its front; errors are those of the first curves."""
    style, lying = load_style("long-sit", op3), [lie(op3, SUPINE), lie(op3, PRONE)]
    both = Sensed(
        **{name: np.stack([getattr(one, name) for one in lying]) for name in vars(lying[0])}
    )
    alone = [follow(op3, style) for _ in lying]
    together = StyleFollower(op3, lambda _, seen: style.choose(seen), n=2)
    for _ in range(60):
        again = together.update(both, STEP)
        own = [one.update(sensed, STEP).size for one, sensed in zip(alone, lying, strict=True)]
        assert again.tolist() == np.flatnonzero(own).tolist()
    assert together.restarts.sum() >= 1
    for row, one in enumerate(alone):
        np.testing.assert_array_equal(together.wanted[row], one.wanted[0])
        np.testing.assert_array_equal(together.mean_error[row], one.mean_error[0])
        assert together.restarts[row] == one.restarts[0]


def test_errors_are_those_of_the_true_features_where_they_are_known(op3: Robot):
    follower, sensed = follow(op3, load_style("long-sit", op3)), lie(op3, SUPINE)
    follower.update(sensed, STEP)
    true_features = follower.measured + np.array([[0.1, 0.0, 0.0]])
    follower.update(sensed, STEP, true_features)
    measured = follow(op3, load_style("long-sit", op3))
    for _ in range(2):
        measured.update(sensed, STEP)
    off = follower.mean_error - measured.mean_error
    assert np.abs(off[0, 0]) == pytest.approx(0.1, abs=0.03)
    assert off[0, 1:] == pytest.approx([0.0, 0.0])
