"""Coarse steps: the longest that divide the control period, and in which servos stay calm."""

import numpy as np
import pytest

from humanoid_getup.experiments.disturbances.disturbance import Scenarios
from humanoid_getup.experiments.rollouts.play import play
from humanoid_getup.motions.build import lay_down
from humanoid_getup.simulation.coarse_step import find_coarse_step
from humanoid_getup.simulation.world import World
from robots import load_robot


@pytest.mark.parametrize(
    ("name", "steps"), [("op3", 1), ("wolfgang", 1), ("toddlerbot", 1), ("human", 2)]
)
def test_a_lying_robot_rests_in_coarse_steps(name: str, steps: int):
    """In twice as long steps the human's wrists swing ever more."""
    world = World(load_robot(name))
    robot, step = world.robot, find_coarse_step(world)
    assert step == pytest.approx(robot.control_period / steps)
    lying = lay_down(world, "supine", robot.standing.joint_pos)
    held = np.tile(robot.standing.joint_pos, (1, round(1.5 / robot.control_period), 1))
    record = play(world.vary(timestep=step), Scenarios.nominal(world, lying), held)
    assert not record.diverged.any()
    last = record.joint_pos[0, -20:]
    assert np.ptp(last, axis=0).max() < 0.01
