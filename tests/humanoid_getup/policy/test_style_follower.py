"""One robot on style curves: which it begins on, when it restarts, and when it is lost."""

import numpy as np
import pytest

from humanoid_getup.policy.observation import Sensed
from humanoid_getup.policy.style_follower import LOST, StyleFollower
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


@pytest.fixture
def follower(op3: Robot) -> StyleFollower:
    return follow(op3, load_style("long-sit", op3))


def test_the_first_measurement_chooses_the_curves(op3: Robot, follower: StyleFollower):
    assert follower.summarize() is None
    assert not follower.update(lie(op3, SUPINE), STEP).size
    assert follower.wanted == pytest.approx(follower.measured)
    targets, features = follower.observe()
    assert (targets.shape, features.shape) == ((1, 12), (1, 3))


def test_a_robot_that_stays_lying_restarts_on_new_curves(op3: Robot, follower: StyleFollower):
    restarts = [follower.update(lie(op3, SUPINE), STEP).size for _ in range(100)]
    assert sum(restarts) >= 1
    assert follower.wanted == pytest.approx(follower.measured) or not restarts[-1]
    assert follower.summarize().restarts == sum(restarts)
    follower.reset()
    assert follower.summarize() is None


def test_a_robot_is_lost_where_no_curves_begin(op3: Robot):
    """Only its back has curves here, and it lies on its front."""
    supine = Style(name="one", curves=load_style("long-sit", op3).curves[:1])
    follower = follow(op3, supine)
    steps = 0
    while not follower.is_lost:
        assert not follower.update(lie(op3, PRONE), STEP).size
        steps += 1
        assert steps < 200
    assert LOST < steps * STEP < 2.0 * LOST
    follower.reset()
    assert not follower.is_lost
