"""Moves go where they cost less, within the servos' limits, and a seed repeats them."""

from collections.abc import Iterator

import numpy as np
import pytest

from humanoid_getup.experiments.starts import sample_fall
from humanoid_getup.filtering.dynamics_filter import CHECK_DISTURBANCE
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies import crawl
from humanoid_getup.strategies.crawl import MOVE, REST, Crawl, Move
from robots import FULL_TORQUE, Posture, Robot
from robots.kinematics import read_posture
from robots.quaternion import Array


@pytest.fixture(scope="module")
def world(op3: Robot) -> World:
    return World(op3)


@pytest.fixture(scope="module")
def start(world: World) -> Posture:
    return sample_fall(world, "left").posture


def ahead(position: Array) -> Array:
    return -position[..., 0]


def search(world: World, start: Posture) -> Move:
    move = Crawl(world, FULL_TORQUE, CHECK_DISTURBANCE).search(
        start, ahead, np.random.default_rng(0)
    )
    assert move is not None
    return move


@pytest.fixture(scope="module", autouse=True)
def small_search() -> Iterator[None]:
    """Sample a fifth of the moves."""
    with pytest.MonkeyPatch.context() as patch:
        for name, number in (("SAMPLES", 12), ("GENERATIONS", 2), ("WORLDS", 2)):
            patch.setattr(crawl, name, number)
        yield


@pytest.fixture(scope="module")
def move(world: World, start: Posture) -> Move:
    return search(world, start)


def test_a_move_goes_where_it_costs_less(world: World, start: Posture, move: Move):
    end = read_posture(world.robot, world.model, move.qpos[-1])
    assert end.position[0] - start.position[0] > 0.05
    assert move.cost >= ahead(end.position), "it is that of the worst world"


def test_its_targets_keep_the_limits_and_end_at_rest(world: World, start: Posture, move: Move):
    robot = world.robot
    assert len(move.qpos) == len(move.target) == round((MOVE + REST) / robot.control_period)
    assert np.all((move.target >= robot.lower) & (move.target <= robot.upper))
    steps = np.abs(np.diff(np.vstack([start.joint_pos, move.target]), axis=0))
    assert np.all(steps <= robot.max_velocity * robot.control_period)
    resting = move.target[-round(0.5 * REST / robot.control_period) :]
    np.testing.assert_allclose(resting, np.broadcast_to(resting[-1], resting.shape), atol=1e-12)


def test_the_same_seed_finds_the_same_move(world: World, start: Posture, move: Move):
    np.testing.assert_array_equal(search(world, start).target, move.target)
