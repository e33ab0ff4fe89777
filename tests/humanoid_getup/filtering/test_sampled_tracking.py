"""Sampled tracking: a robot finds targets with which it follows postures that it only sees."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from humanoid_getup.experiments.disturbances import Scenarios
from humanoid_getup.experiments.rollouts import Experiment
from humanoid_getup.filtering.sampled_tracking import Branches, SampledTracker
from humanoid_getup.motions.course import Course
from humanoid_getup.motions.motion_database import find_motion
from humanoid_getup.simulation.vectorized_simulation import VecSim
from humanoid_getup.simulation.world import World, count_substeps
from robots import Robot
from robots.individual import Individual
from robots.kinematics import place


@pytest.fixture(scope="module")
def seen(op3: Robot) -> Course:
    """The postures of a rise, without the targets that made them."""
    return Course.of(find_motion(op3, "supine_sit_up_fast"))


def lie(world: World, course: Course) -> Scenarios:
    """Lie as the course begins, with servos of 70 % of their strength."""
    start = Scenarios.nominal(world, place(world.robot, world.model, course[:1].end))
    start.parameters.strength[:] = 0.7
    return start


def track(world: World, course: Course, seed: int, samples: int = 60) -> Branches:
    rng = np.random.default_rng(seed)
    tracker = SampledTracker(
        world, lie(world, course), samples=samples, window=0.06, rng=rng, threads=1
    )
    return tracker.track(course, tracker.start, balance_from=round(0.75 * len(course)))[-1]


@pytest.fixture(scope="module")
def tracked(world: World, seen: Course) -> Branches:
    return track(world, seen, 1)


def test_a_weak_robot_that_sees_only_postures_finds_targets_that_stand(world: World, seen, tracked):
    start, compare = lie(world, seen), Experiment(world, threads=1).compare
    assert not compare(start, [seen.joint_target]).stood[0, 0], "the angles alone do not"
    assert compare(start, list(tracked.sent)).stood.any()


def test_targets_stay_in_the_ranges_and_are_no_faster_than_the_servos(op3: Robot, seen, tracked):
    assert tracked.windows * tracked.sent.shape[1] > len(seen) - 1
    assert (tracked.sent >= op3.lower).all() and (tracked.sent <= op3.upper).all()
    whole = np.concatenate(
        [np.tile(seen.joint_pos[:1], (len(tracked.sent), 1, 1)), tracked.sent], 1
    )
    assert (np.abs(np.diff(whole, axis=1)) <= op3.max_velocity * op3.control_period + 1e-9).all()


def test_the_same_seed_gives_the_same_targets(world: World, seen: Course):
    few = seen[:60]
    first, again, other = (track(world, few, seed, samples=12).sent for seed in (3, 3, 4))
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)


def test_postures_that_no_body_can_follow_are_given_up(world: World, seen: Course):
    flying = replace(seen, position=seen.position + np.array([0.0, 0.0, 2.0]))
    tracker = SampledTracker(
        world, lie(world, seen), samples=4, window=0.06, rng=np.random.default_rng(1), threads=1
    )
    end = tracker.track(flying, tracker.start, balance_from=len(flying))[-1]
    assert end.windows == 1
    assert not tracker.has_followed(flying, end)


def test_a_branch_goes_where_its_targets_lead_also_with_delay_friction_and_a_bad_supply(
    op3: Robot, seen: Course
):
    own = Individual(delay=0.02, supply_resistance=0.5, load_friction=0.2)
    world = World(op3.with_individual(own))
    start = Scenarios.nominal(world, place(world.robot, world.model, seen[:1].end))
    end = track(world, seen[:80], 1, samples=8)
    sim = VecSim(world, 1, threads=1)
    sim.set_parameters(np.arange(1), lie(world, seen).parameters)
    sim.place(np.arange(1), start.starts)
    for target in end.sent[0]:
        sim.hold(target[None], count_substeps(world.model, op3.control_period))
    np.testing.assert_allclose(sim.qpos[0], end.state["qpos"][0, 0], atol=1e-12)
