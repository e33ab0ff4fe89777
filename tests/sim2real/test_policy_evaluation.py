"""Evaluation of policies: what they see and do, and diverged physics is no stand."""

from collections.abc import Callable

import numpy as np
import pytest
from policy_functions import remember_actions

from humanoid_getup.policy.action import ActionSpec, build_posture_spec
from humanoid_getup.policy.observation import StyleInput, list_terms
from humanoid_getup.simulation.domain_parameters import DomainParameters
from humanoid_getup.style.style_file import load_any_style
from robots.kinematics import place
from sim2real.environment.env_options import ObservationNoise
from sim2real.environment.physics.training_simulation import TrainingSim
from sim2real.policy_evaluation import PolicyDriver, PolicyRollouts, roll_out_policy


def idle(action: ActionSpec) -> Callable[[np.ndarray], np.ndarray]:
    return lambda observations: np.zeros((len(observations), action.size))


def test_a_robot_that_diverged_never_stood_and_the_others_did(
    op3, action, world, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)  # where MuJoCo writes its log
    sim = TrainingSim(world, 3, cycles=action.cycles, threads=1)
    starts = np.tile(place(op3, world.model, op3.standing), (3, 1))

    def hit(step: int) -> None:
        if step == 2:
            sim.push(np.array([1]), np.full((1, 3), np.nan))

    driver = PolicyDriver(action=action, act=remember_actions(idle(action)))
    rises = roll_out_policy(sim, driver, starts, duration=3.5, on_step=hit)
    assert rises.outcome.stood.tolist() == [True, False, True]
    assert not rises.outcome.upright[1].any()
    assert rises.outcome.upright[[0, 2]].all()
    assert np.isfinite(rises.qpos[[0, 2]]).all()
    # Positions, targets and features are those at the end of each policy step.
    steps = round(3.5 / sim.step_time)
    shapes = [array.shape for array in (rises.qpos, rises.target, rises.features)]
    assert shapes == [(3, steps, world.model.nq), (3, steps, op3.n), (3, steps, 3)]
    np.testing.assert_array_equal(rises.features[:, -1], sim.measure_features())


def roll_out(world, action, starts, policy, **options) -> PolicyRollouts:
    noise = ObservationNoise(gravity=0.05, gyro=0.05)
    sim = TrainingSim(world, len(starts), cycles=action.cycles, noise=noise, threads=1)
    driver = PolicyDriver(action=action, act=remember_actions(policy))
    return roll_out_policy(sim, driver, starts, duration=0.3, **options)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_what_a_policy_asks_beyond_one_counts_as_one(action, world, falls, sign):
    """In what the servos do, and in the last action that it observes."""
    observed = []

    def constant(value: float):
        def policy(observations: np.ndarray) -> np.ndarray:
            observed.append(observations[:, -1 - action.size : -1])
            return np.full((len(observations), action.size), value)

        return policy

    one, much, none = (
        roll_out(world, action, falls[:2], constant(value)) for value in (sign, 5.0 * sign, 0.0)
    )
    np.testing.assert_array_equal(one.qpos, much.qpos)
    assert np.abs(one.qpos - none.qpos).max() > 0.01
    steps = len(observed) // 3
    assert not observed[0].any(), "there is no action before the first"
    assert np.all(np.array(observed[1:steps]) == sign)
    np.testing.assert_array_equal(observed[:steps], observed[steps : 2 * steps])


def test_the_torque_limit_is_observed_and_the_last_positions_are_kept(op3, action, world, falls):
    sim = TrainingSim(world, 2, cycles=action.cycles, threads=1)
    limits = DomainParameters.nominal(world, 2, torque_limit=2.05)
    sim.set_parameters(sim.everyone, limits)
    seen = []

    def idle(observations: np.ndarray) -> np.ndarray:
        seen.append(observations[:, -1])
        return np.zeros((len(observations), action.size))

    driver = PolicyDriver(action=action, act=remember_actions(idle))
    rollouts = roll_out_policy(sim, driver, falls[:2], duration=0.1)
    np.testing.assert_array_equal(rollouts.qpos[:, -1], sim.qpos)
    share = min(2.05 / op3.max_torque.max(), action.pwm_limit)
    assert np.array(seen) == pytest.approx(np.full((len(seen), 2), share))


def test_a_robot_that_restarts_on_other_curves_has_no_memory(op3, world, falls):
    """Its network remembers a 1 always; the robot stays lying, however high its curves lead."""
    spec, style = build_posture_spec(op3), StyleInput(memory=1)
    ends = np.cumsum([term.size for term in list_terms(op3, spec, style)])
    at = [term.name for term in list_terms(op3, spec, style)].index("last_action")
    memory = []

    def lie_still(observations: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        memory.append(observations[:, ends[at] - 1])
        return np.zeros((len(observations), spec.size)), np.ones((len(observations), 1))

    curves = load_any_style(op3)
    sim = TrainingSim(world, 4, cycles=spec.cycles, threads=1)
    driver = PolicyDriver(
        action=spec,
        act=lie_still,
        style=style,
        choose_style=lambda _, features: curves.choose(features),
    )
    rollouts = roll_out_policy(sim, driver, falls[:4], duration=5.0)
    assert rollouts.restarts.sum() >= 2
    blank = np.array(memory[1:]) == 0.0  # (steps, 4)
    assert blank.sum(axis=0).tolist() == rollouts.restarts.tolist()
