"""Moves go where they cost less, within the servos' limits, and a seed repeats them."""

from collections.abc import Iterator

import numpy as np
import pytest
from records import make_record

from humanoid_getup.experiments.disturbances.disturbance import Scenarios
from humanoid_getup.experiments.judging.record import Record
from humanoid_getup.experiments.starts.falls import sample_fall
from humanoid_getup.filtering.dynamics_filter import CHECK_DISTURBANCE
from humanoid_getup.simulation.placement import Placement
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.rise_motion import make_move
from humanoid_getup.strategies.search import crawl
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
    robot, best_fair = world.robot, 0.4

    class PretendExperiment:
        def __init__(self, world: World, threads: int) -> None:
            pass

        def play(self, scenarios: Scenarios, sent: Array) -> Record:
            runs, samples, _ = sent.shape
            row = np.arange(runs) // crawl.WORLDS
            reach = np.linspace(0.1, 0.5, crawl.SAMPLES)
            reach[-2] = best_fair  # the one after it gets farther, and overloads a servo
            qpos = np.tile(scenarios.starts[:, np.newaxis], (1, samples, 1))
            root = robot.layout(world.model).root_qpos
            qpos[:, :, root] = start.position[0] + reach[row, np.newaxis]
            seconds = MOST_SATURATION + np.where(row % 2 == 1, 0.1, -0.1)
            is_full = np.arange(samples) * robot.control_period < seconds[:, np.newaxis]
            torque = np.where(is_full[..., np.newaxis], robot.max_torque, 0.0)
            return make_record(
                robot, (runs, samples), robot.control_period, qpos=qpos, torque=torque
            )

    monkeypatch.setattr(crawl, "Experiment", PretendExperiment)
    assert -search(world, start).cost == pytest.approx(start.position[0] + best_fair)


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
