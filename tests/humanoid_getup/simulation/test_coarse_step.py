"""Coarse steps: the longest that divide the control period, and in which servos stay calm."""

import numpy as np
import pytest

from humanoid_getup.experiments.disturbances.disturbance import USUAL
from humanoid_getup.experiments.rollouts.play import play
from humanoid_getup.motions.build import lay_down
from humanoid_getup.simulation.coarse_step import find_coarse_step
from humanoid_getup.simulation.world import World
from robots import load_robot


@pytest.mark.parametrize(
    ("name", "steps"), [("op3", 1), ("wolfgang", 1), ("toddlerbot", 1), ("human", 2)]
)
def test_no_rollout_diverges_in_coarse_steps(name: str, steps: int):
    """In twice as long steps two of eight of the human do, which lies disturbed on its back."""
    world = World(load_robot(name))
    robot, step = world.robot, find_coarse_step(world)
    assert step == pytest.approx(robot.control_period / steps)
    lying = lay_down(world, "supine", robot.standing.joint_pos)
    scenarios = USUAL.sample(world, lying, 8, np.random.default_rng(0))
    held = np.tile(robot.standing.joint_pos, (8, round(1.5 / robot.control_period), 1))
    record = play(world.vary(timestep=step), scenarios, held)
    assert not record.diverged.any()
