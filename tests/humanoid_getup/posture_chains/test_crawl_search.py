"""Crawls lead nearer to a place in all worlds, within limits, and a seed repeats them."""

from dataclasses import replace

import numpy as np
import pytest

from humanoid_getup.experiments.falls import sample_fall
from humanoid_getup.filtering.dynamics_filter import CHECK_DISTURBANCE
from humanoid_getup.posture_chains import crawl_search
from humanoid_getup.posture_chains.crawl_search import MOST_SATURATION, Crawl, CrawlSearch
from humanoid_getup.posture_chains.move_player import SETTLING
from humanoid_getup.simulation.placement import Placement
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.planned_rise import make_crawl
from robots import FULL_TORQUE, Posture, Robot
from robots.kinematics import read_posture
from robots.quaternion import Array

AHEAD, NEAR = 0.3, 0.2  # m to the place, and near enough


@pytest.fixture(scope="module")
def start(world: World) -> Posture:
    fall = sample_fall(world, "left").posture
    return replace(fall, position=fall.position * [0.0, 0.0, 1.0])


def apart(position: Array) -> Array:
    return np.maximum(AHEAD - position[..., 0], 0.0)


def search(world: World, start: Posture, *, budget: float = 1500.0, threads: int = 0):
    crawls = CrawlSearch(world, FULL_TORQUE, CHECK_DISTURBANCE, threads=threads)
    return crawls.find(start, apart, NEAR, budget, np.random.default_rng(0))


@pytest.fixture(scope="module")
def crawl(world: World, start: Posture) -> Crawl:
    found = search(world, start)
    assert found is not None
    return found


def test_a_crawl_leads_near_enough_in_all_worlds(world: World, crawl: Crawl):
    end = read_posture(world.robot, world.model, crawl.qpos[-1])
    assert apart(end.position) <= crawl.distance <= NEAR, "it is that of the worst world"


def test_its_targets_keep_the_limits_and_end_at_rest(world: World, start: Posture, crawl: Crawl):
    robot = world.robot
    assert len(crawl.qpos) == len(crawl.target)
    assert np.all((crawl.target >= robot.lower) & (crawl.target <= robot.upper))
    steps = np.abs(np.diff(np.vstack([start.joint_pos, crawl.target]), axis=0))
    assert np.all(steps <= robot.max_velocity * robot.control_period)
    resting = crawl.target[-round(0.5 * SETTLING / robot.control_period) :]
    np.testing.assert_allclose(resting, np.broadcast_to(resting[-1], resting.shape), atol=1e-12)


def test_the_same_seed_finds_the_same_crawl_with_any_threads(world, start, crawl):
    again = search(world, start, threads=1)
    np.testing.assert_array_equal(again.target, crawl.target)


def test_a_crawl_ends_before_a_servo_has_all_its_torque_for_long(world, start, crawl, monkeypatch):
    """All servos have it after the first half, where that is tested."""
    begins = len(crawl.target) // 2

    def saturate(_robot: Robot, torque: Array, *_: Array) -> Array:
        return np.broadcast_to(np.arange(torque.shape[1])[:, np.newaxis] >= begins, torque.shape)

    monkeypatch.setattr(crawl_search, "find_saturation", saturate)
    shorter = search(world, start, budget=250.0)
    allowed = begins + MOST_SATURATION / world.robot.control_period
    assert len(shorter.target) <= allowed < len(crawl.target)
    assert shorter.distance < AHEAD


def test_a_crawl_that_is_played_has_the_place_and_heading_of_its_rollout(world, start, crawl):
    motion = make_crawl(world, start, crawl)
    truth = read_posture(world.robot, world.model, crawl.qpos[-2])
    assert not motion.rises
    assert motion.strategy == "crawl"
    np.testing.assert_allclose(motion.position[-1], truth.position)
    assert Placement.of(motion.posture(-1)) == Placement.of(truth)
    np.testing.assert_array_equal(motion.joint_target, crawl.target)
