"""A big body is searched for in a world that costs less, a small one in the world itself."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from humanoid_getup.experiments.disturbances.disturbance import Scenarios
from humanoid_getup.experiments.rollouts.play import Experiment
from humanoid_getup.filtering.coarse_world import coarsen
from humanoid_getup.filtering.dynamics_filter import DynamicsFilter
from humanoid_getup.simulation.world import World, count_substeps
from robots import load_robot
from robots.kinematics import place


@pytest.fixture(scope="module")
def human_world() -> World:
    return World(load_robot("human"))


def test_a_big_one_has_longer_steps_and_no_dry_friction_there_alone(human_world: World):
    coarse = coarsen(human_world)
    assert coarse.model.opt.timestep == pytest.approx(0.01 / 3)
    assert count_substeps(coarse.model, human_world.robot.control_period) == 3
    assert not coarse.model.dof_frictionloss.any()
    assert human_world.model.dof_frictionloss.any()
    assert human_world.model.opt.timestep == 0.002
    assert coarse.scene is human_world.scene


def test_checks_and_what_is_played_in_the_end_are_of_the_world_itself(human_world: World):
    start = human_world.robot.standing
    dynamics, target = DynamicsFilter(human_world), np.tile(start.joint_pos, (5, 1))
    nominal = Scenarios.nominal(human_world, place(human_world.robot, human_world.model, start))
    twin = Experiment(human_world).play(nominal, np.tile(start.joint_pos, (1, 50, 1)))
    found: Any = SimpleNamespace(candidate=None, target=target, moving=5)
    rough = dynamics.replay(start, [found], [target])[0].qpos[:50]
    fine = dynamics.confirm(start, found).qpos[:50]
    np.testing.assert_array_equal(fine, twin.qpos[0])
    assert np.abs(rough - fine).max() > 0.0
