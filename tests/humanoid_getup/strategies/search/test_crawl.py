"""Moves go where they cost less, within the servos' limits, and a seed repeats them."""

from collections.abc import Iterator
from types import SimpleNamespace

import numpy as np
import pytest

from humanoid_getup.experiments.disturbances.disturbance import Scenarios
from humanoid_getup.experiments.starts.falls import sample_fall
from humanoid_getup.filtering.dynamics_filter import CHECK_DISTURBANCE
from humanoid_getup.simulation.placement import Placement
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies import crawl
from humanoid_getup.strategies.rise_motion import make_move
from humanoid_getup.strategies.search.crawl import (
    MOST_SATURATION,
    MOVE,
    REST,
    Crawl,
    Move,
)
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


def test_a_move_that_overloads_a_servo_is_beaten_by_a_shorter_one(
    world: World, start: Posture, monkeypatch: pytest.MonkeyPatch
):
    """Of the moves that get anywhere, every other one has all its torque for too long."""
    crawl = Crawl(world, FULL_TORQUE, CHECK_DISTURBANCE)
    best_fair = 0.4

    def play(scenarios: Scenarios, targets: Array) -> SimpleNamespace:
        count = len(targets)
        reach = np.linspace(0.1, 0.5, count)
        overloads = np.arange(count) % 2 == 1  # the one that gets farthest among them
        reach[-2] = best_fair
        qpos = np.tile(scenarios.starts[None, :, None], (count, 1, targets.shape[1], 1))
        root = world.robot.layout(world.model).root_qpos
        qpos[:, :, -1, root : root + 3] = start.position
        qpos[:, :, -1, root] += reach[:, None]
        record = SimpleNamespace(
            qpos=qpos.reshape(-1, *qpos.shape[2:]),
            diverged=np.zeros(count * len(scenarios), dtype=bool),
        )
        saturation = np.where(overloads, MOST_SATURATION + 0.1, MOST_SATURATION - 0.1)
        return SimpleNamespace(record=record, saturation=np.repeat(saturation, len(scenarios)))

    monkeypatch.setattr(crawl, "_play", play)
    move = crawl.search(start, ahead, np.random.default_rng(0))
    assert move is not None
    assert -move.cost == pytest.approx(start.position[0] + best_fair)


def test_a_move_that_is_played_has_the_place_and_heading_of_its_rollout(
    world: World, start: Posture, move: Move
):
    motion = make_move(world, start, move)
    truth = read_posture(world.robot, world.model, move.qpos[-2])
    assert not motion.rises
    assert motion.strategy == "crawl"
    np.testing.assert_allclose(motion.position[-1], truth.position)
    assert Placement.of(motion.posture(-1)) == Placement.of(truth)
    np.testing.assert_array_equal(motion.joint_target, move.target)
