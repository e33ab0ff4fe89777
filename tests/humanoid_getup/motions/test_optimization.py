from dataclasses import replace

import numpy as np
import pytest
from authored import load_robot_keyframes

from humanoid_getup.experiments.disturbances.disturbance import USUAL, Scenarios
from humanoid_getup.experiments.rollouts.play import play
from humanoid_getup.motions import optimization
from humanoid_getup.motions.build import settle
from humanoid_getup.motions.motion import hold_last
from humanoid_getup.motions.optimization import TrajectoryOptimizer, make_scenarios
from humanoid_getup.motions.preference import Preference
from humanoid_getup.motions.scoring import score
from humanoid_getup.simulation.domain_parameters import DomainParameters
from robots import TorqueLimit
from robots.servo import LIMIT_MODES

HOLD = 1.0


@pytest.fixture(scope="module")
def keyframes(op3):
    return next(k for k in load_robot_keyframes(op3) if k.name == "squat_to_stand")


@pytest.fixture(scope="module")
def start(world, keyframes):
    return settle(world, keyframes)


@pytest.fixture(scope="module")
def trace(world, keyframes, start):
    """The keyframes, and a robot that stays where it is."""
    targets = keyframes.targets(world.robot, HOLD + 0.2)
    still = hold_last(targets[:1], len(targets))
    return play(
        world,
        Scenarios(starts=np.tile(start, (2, 1)), parameters=DomainParameters.nominal(world, 2)),
        np.array([targets, still]),
    )


def test_scenarios_cover_several_torque_limits_in_the_robots_own_mode(world, start):
    scenarios = make_scenarios(world, start, 2.0, 11, USUAL, np.random.default_rng(0))
    starts, parameters = scenarios.starts, scenarios.parameters
    limits = parameters.torque_limit
    np.testing.assert_allclose(limits, [2.0, 4.1, *[2.0, 3.0, 2.5] * 3], atol=0.01)
    assert {LIMIT_MODES[mode] for mode in parameters.limit_by} == {TorqueLimit().on(world.robot).by}
    np.testing.assert_allclose(starts[:2], np.tile(start, (2, 1)), atol=0.01)
    assert len(np.unique(starts[2:], axis=0)) == len(starts) - 2
    # None has more torque than permitted.
    rng = np.random.default_rng(0)
    scenarios = make_scenarios(world, start, 2.7, 11, USUAL, rng, bounds=(0.0, 2.7))
    limits = scenarios.parameters.torque_limit
    np.testing.assert_allclose(limits, [2.7, 2.7, *[2.7, 2.7, 2.5] * 3], atol=0.01)


def test_keyframes_that_fail_are_changed_until_they_succeed_once(world, keyframes, start):
    away = np.random.default_rng(0).normal(0.0, 0.9, len(keyframes.genes))
    failing = keyframes.with_genes(keyframes.genes + away, world.robot)
    optimizer = TrajectoryOptimizer(world, start)
    assert optimizer.find_success(failing, 0, 3) is None
    found = optimizer.find_success(failing, 8, 3)
    assert found is not None
    assert optimizer.find_success(found, 0, 0) is found


def test_a_preference_replaces_what_the_keyframes_weigh(world, keyframes, trace):
    costs = [
        score(trace, world, replace(keyframes, torque_cost=t), HOLD, Preference.of("time"))[0]
        for t in (0.0, 5.0)
    ]
    np.testing.assert_array_equal(*costs)


@pytest.mark.slow
def test_keyframes_that_nearly_succeed_are_improved_by_the_worlds_in_which_they_fail(
    world, op3, monkeypatch
):
    """With 1.55 N·m a push-up stands in 36 of 48 worlds."""
    monkeypatch.setattr(optimization, "PRACTICE", 16)
    monkeypatch.setattr(optimization, "ROUNDS", 1)
    monkeypatch.setattr(optimization, "EACH_ROUND", 1)
    weak = next(k for k in load_robot_keyframes(op3) if k.name == "prone_push_up_fast")
    weak = replace(weak, torque_limit=1.55)
    optimizer = TrajectoryOptimizer(world, settle(world, weak), bounds=(0.0, 1.55))
    before = optimizer.judge(weak, 0)[1].sum()
    better = optimizer.improve(weak, 0)
    assert optimizer.judge(better, 0)[1].sum() > before
    assert len(better.keys) == len(weak.keys)
    assert better.torque_limit == weak.torque_limit
