"""The space of the root's position: a point over the ground and outside the obstacles."""

from dataclasses import replace

import numpy as np
import pytest

from humanoid_getup.planning.position_space import PointProblem
from humanoid_getup.scenes.obstacle import make_capsule
from humanoid_getup.scenes.scene import FLAT_SCENE

BALL = make_capsule("ball", np.array([1.0, 0.0, 0.5]), np.array([1.0, 0.0, 0.5]), 0.2)

# Each component of the direction, the one ahead included, changes by up to tan 15 deg.
MOST_SIDEWAYS = np.tan(np.radians(15.0)) / (1.0 - np.tan(np.radians(15.0)))


@pytest.fixture(scope="module")
def positions() -> PointProblem:
    scene = replace(FLAT_SCENE, obstacles=(BALL,))
    return PointProblem(scene, np.array([0.0, 0.0, 0.3]), np.array([0.3, 0.4, 0.3]))


def test_positions_are_sampled_around_start_and_goal(positions):
    """They are 0.5 m apart: 0.55 m around both."""
    rng = np.random.default_rng(0)
    samples = np.array([positions.sample(rng) for _ in range(2000)])
    np.testing.assert_allclose(samples.min(axis=0), [-0.55, -0.55, -0.25], atol=0.01)
    np.testing.assert_allclose(samples.max(axis=0), [0.85, 0.95, 0.85], atol=0.01)


def test_a_position_steps_five_centimeters_straight_and_around(positions):
    rng, near, target = np.random.default_rng(0), np.zeros(3), np.array([0.0, 0.0, 1.0])
    for _ in range(100):
        steps = positions.steer(near, target, target, 4, rng)
        np.testing.assert_allclose(steps[0], [0.0, 0.0, 0.05])
        np.testing.assert_allclose(np.linalg.norm(steps, axis=1), 0.05)
        sideways = np.abs(steps[1:, :2] / steps[1:, 2:])
        assert np.all(sideways <= MOST_SIDEWAYS + 1e-9)
    assert sideways.max() > 0.0
    np.testing.assert_allclose(
        positions.steer(near, np.array([0.02, 0.0, 0.0]), target, 1, rng)[0], [0.02, 0.0, 0.0]
    )
    np.testing.assert_array_equal(positions.steer(near, near, target, 3, rng), np.zeros((3, 3)))


@pytest.mark.parametrize(
    ("position", "fails"),
    [
        ([0.0, 0.0, 0.001], False),
        ([0.0, 0.0, 0.0], False),
        ([0.0, 0.0, -0.001], True),
        ([0.81, 0.0, 0.5], True),
        ([0.79, 0.0, 0.5], False),
    ],
)
def test_the_root_stays_above_the_ground_and_outside_obstacles(positions, position, fails):
    assert positions.fails(np.zeros(3), np.array(position)) == fails
