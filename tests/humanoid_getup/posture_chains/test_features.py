"""Features tell how near a robot at rest is to a stand."""

import numpy as np
import pytest

from humanoid_getup.motions.build import lay_down
from humanoid_getup.posture_chains.features import StandMeter
from humanoid_getup.simulation.world import World
from robots import quaternion
from robots.kinematics import place


@pytest.fixture(scope="module")
def standing(world: World) -> np.ndarray:
    return place(world.robot, world.model, world.robot.standing)


def test_a_stand_is_at_the_goal_and_a_fall_far_from_it(world: World, standing: np.ndarray):
    lying = lay_down(world, "supine", world.robot.standing.joint_pos)
    features = StandMeter(world).measure(np.array([standing, lying]))
    assert features.progress[0] > 0.95
    assert features.progress[1] < 0.15
    assert features.neck[0] == pytest.approx(1.0, abs=0.02)
    assert np.allclose(features.up[1], [1.0, 0.0, 0.0], atol=0.2)  # supine: the chest looks up


def test_a_lifted_sole_and_a_lean_count_less(world: World, standing: np.ndarray):
    lifted, leaning = standing.copy(), standing.copy()
    lifted[2] += 0.05
    tilt = quaternion.from_axis_angle(np.array([0.0, 1.0, 0.0]), 0.5)
    layout = world.robot.layout(world.model)
    leaning[layout.root_orientation] = tilt
    features = StandMeter(world).measure(np.array([standing, lifted, leaning]))
    assert features.flatness[1] < 0.5 < features.flatness[0]
    assert features.progress[0] > features.progress[2] > 0.2
    assert features.cells.shape == (3, 6)
