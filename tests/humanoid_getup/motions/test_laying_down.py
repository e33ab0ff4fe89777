"""A robot is laid on a side on which it stays."""

import numpy as np
import pytest

from humanoid_getup.experiments.starts.falls import classify
from humanoid_getup.motions.build import lay_down, lay_on_side
from humanoid_getup.simulation.world import World
from robots import load_robot


@pytest.fixture(scope="module")
def wolfgang() -> World:
    return World(load_robot("wolfgang"))


def find_side(world: World, qpos: np.ndarray) -> str | None:
    return classify(qpos[world.robot.layout(world.model).root_orientation])


@pytest.mark.parametrize("side", ["prone", "left"])
def test_op3_stays_on_each_side_with_the_joints_of_its_stance(world: World, side):
    laid = lay_on_side(world, side, np.random.default_rng(0))
    assert laid is not None
    assert np.array_equal(laid, lay_down(world, side, world.robot.standing.joint_pos))
    assert find_side(world, laid) == side


def test_a_robot_that_rolls_off_its_side_is_laid_there_with_other_joints(wolfgang: World):
    rolled = lay_down(wolfgang, "left", wolfgang.robot.standing.joint_pos)
    assert find_side(wolfgang, rolled) == "prone"
    laid = lay_on_side(wolfgang, "left", np.random.default_rng(0))
    assert laid is not None
    assert find_side(wolfgang, laid) == "left"
    again = lay_on_side(wolfgang, "left", np.random.default_rng(0))
    assert np.array_equal(laid, again)
