"""Evaluation of policies: what they see and do, on other robots and in other physics."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from policy_functions import make_policy
from records import make_record

from humanoid_getup.experiments.disturbances import RandomAxis
from humanoid_getup.experiments.falls import Fall
from humanoid_getup.experiments.judging.record import Record
from humanoid_getup.policy.action import ActionSpec, build_posture_spec
from humanoid_getup.policy.observation import StyleInput, list_terms
from humanoid_getup.policy.slope_legs import SlopeLegs
from humanoid_getup.scenes.named_scenes import load_scene
from humanoid_getup.scenes.scene import FLAT_SCENE
from humanoid_getup.simulation.domain_parameters import DomainParameters
from humanoid_getup.style.style import load_any_style
from robots import Robot, quaternion
from robots.kinematics import place, place_postures
from sim2real import evaluation
from sim2real.environment.env_options import ObservationNoise
from sim2real.environment.training_simulation import TrainingSim
from sim2real.environment.training_world import MODEL_VARIANTS, build_training_world
from sim2real.evaluation import Perturbation, PolicyTrial
from sim2real.policy_evaluation import (
    PolicyFigures,
    PolicyRollouts,
    PolicyRun,
    RunningOutcome,
    judge_given,
    summarize_rollouts,
)


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

    policy = make_policy(op3, action, idle(action))
    rises = PolicyRun(sim=sim, policy=policy, duration=3.5, on_step=hit).run(starts)
    assert rises.outcome.stood.tolist() == [True, False, True]
    assert not rises.outcome.upright[1].any()
    assert rises.outcome.upright[[0, 2]].all()
    assert np.isfinite(rises.qpos[[0, 2]]).all()
    # Positions, targets and features are those at the end of each policy step.
    steps = round(3.5 / sim.step_time)
    shapes = [array.shape for array in (rises.qpos, rises.target, rises.features)]
    assert shapes == [(3, steps, world.model.nq), (3, steps, op3.n), (3, steps, 3)]
    np.testing.assert_array_equal(rises.features[:, -1], sim.measure_features())


def roll_out(world, action, starts, act) -> PolicyRollouts:
    noise = ObservationNoise(gravity=0.05, gyro=0.05)
    sim = TrainingSim(world, len(starts), cycles=action.cycles, noise=noise, threads=1)
    policy = make_policy(world.robot, action, act)
    return PolicyRun(sim=sim, policy=policy, duration=0.3).run(starts)


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

    policy = make_policy(op3, action, idle)
    rollouts = PolicyRun(sim=sim, policy=policy, duration=0.1).run(falls[:2])
    np.testing.assert_array_equal(rollouts.qpos[:, -1], sim.qpos)
    share = min(2.05 / op3.max_torque.max(), action.pwm_limit)
    assert np.array(seen) == pytest.approx(np.full((len(seen), 2), share))


def test_a_robot_that_restarts_on_other_curves_has_no_memory(op3, world, falls):
    """Its network remembers a 1 always; the robot stays lying, however high its curves lead."""
    spec, style = build_posture_spec(op3), StyleInput(memory=1)
    ends = np.cumsum([term.size for term in list_terms(op3, spec, style)])
    at = [term.name for term in list_terms(op3, spec, style)].index("last_action")
    memory = []

    def lie_still(observations: np.ndarray) -> np.ndarray:
        memory.append(observations[:, ends[at] - 1])
        return np.zeros((len(observations), spec.size))

    curves = load_any_style(op3)
    sim = TrainingSim(world, 4, cycles=spec.cycles, threads=1)
    rollouts = PolicyRun(
        sim=sim,
        policy=make_policy(op3, spec, lie_still, style),
        choose_style=lambda _, features: curves.choose(features),
        duration=5.0,
    ).run(falls[:4])
    assert rollouts.restarts.sum() >= 2
    blank = np.array(memory[1:]) == 0.0  # (steps, 4)
    assert blank.sum(axis=0).tolist() == rollouts.restarts.tolist()


def test_a_policy_that_asks_for_the_stance_stands_on_a_slope_that_is_known(op3, monkeypatch):
    """In four headings; with the legs of level ground it leans by the slope, or falls."""
    spec, style = build_posture_spec(op3), StyleInput(memory=1)
    slope, headings = np.radians(20.0), np.radians([0.0, 90.0, 180.0, 250.0])
    world = build_training_world(op3, load_scene("slope:20", op3), op3.choose_timestep(0.002))
    stance, turned = op3.standing, quaternion.from_yaw(headings)
    legs = SlopeLegs(op3, 4, slope).compute(turned, np.ones(4))
    starts = place_postures(
        op3,
        world.model,
        np.tile(stance.position + np.array([0.0, 0.0, 0.01]), (4, 1)),
        quaternion.multiply(turned, stance.orientation),
        stance.joint_pos + legs,
    )
    curves = load_any_style(op3)

    def stand() -> list[bool]:
        rollouts = PolicyRun(
            sim=TrainingSim(world, 4, cycles=spec.cycles, threads=1),
            policy=make_policy(op3, spec, idle(spec), style),
            choose_style=lambda _, features: curves.choose(features),
            duration=4.5,
        ).run(starts)
        return rollouts.outcome.stood.tolist()

    assert stand() == [True] * 4
    monkeypatch.setattr(SlopeLegs, "compute", lambda *_: 0.0 * legs)
    assert stand() == [False] * 4


def test_only_a_stand_from_the_end_of_the_given_curves_on_counts_for_the_paper():
    """Curves of 1 s, samples of 6 s at 2 Hz; falling after 4 s does not count."""
    stands = np.array([0, 0] + [1] * 6 + [0] * 4, dtype=bool)
    late = np.array([0, 0, 0] + [1] * 9, dtype=bool)
    upright, duration = np.array([stands, late, stands, stands]), np.array([1.0, 1.0, 1.0, 4.0])
    followed_for = np.array([np.inf, np.inf, 0.5, np.inf])
    assert judge_given(upright, 0.5, duration, followed_for).tolist() == [True, False, False, False]


SHORT = 3.5  # s: a held stand and a little


def try_idle(op3: Robot, action: ActionSpec, **options: Any) -> PolicyTrial:
    return PolicyTrial(policy=make_policy(op3, action, idle(action)), threads=1, **options)


@pytest.mark.parametrize("physics", [None, *MODEL_VARIANTS])
def test_a_robot_that_stands_and_does_nothing_stands_in_any_physics(
    op3: Robot, action: ActionSpec, physics: str | None
):
    trial = try_idle(op3, action, perturbation=Perturbation(physics=physics), duration=SHORT)
    record = trial.run([op3.standing] * 2)
    assert record.outcome.stood.all()
    assert (record.outcome.stand_time <= 0.3).all()
    assert (record.outcome.standing_speed < 0.05).all()
    assert (record.outcome.head_impact == 0.0).all()


def test_a_perturbation_is_in_the_model(op3: Robot, action: ActionSpec):
    """One servo at 60 %, a random one in every robot."""
    world = build_training_world(op3, FLAT_SCENE, 0.002)
    sim = TrainingSim(world, 8, cycles=action.cycles, threads=1)
    tilt = RandomAxis(0.1)
    trial = Perturbation(weak_servo=0.6, mass=1.15, voltage=10.5, friction=0.3, imu_tilt=tilt)
    parameters = trial.draw(world, 8, np.random.default_rng(0))
    assert (np.sort(parameters.strength, axis=1)[:, :2] == [0.6, 1.0]).all()
    assert len(set(parameters.strength.argmin(axis=1))) > 2
    sim.set_parameters(np.arange(8), parameters)
    mass = sim.batch.expand("body_mass").sum(axis=1)
    assert mass == pytest.approx(1.15 * world.model.body_mass.sum())
    assert np.linalg.norm(parameters.imu_tilt, axis=1) == pytest.approx(0.1)


def conclude(op3: Robot, made: Record) -> PolicyFigures:
    """Judge a record of N robots without style."""
    outcome, n = RunningOutcome(op3), len(made.cycles)
    outcome.add(made)
    nothing, none = np.full((n, 3), np.nan), np.zeros(n, dtype=int)
    return PolicyFigures(outcome=outcome.conclude(), style_error=nothing, restarts=none)


def test_figures_count_by_class(op3: Robot):
    """Three robots of 4 s at 2 Hz: one stands from 0.5 s on, one falls, one never stands."""
    upright = np.array([[0, 1, 1, 1, 1, 1, 1, 1], [1] * 7 + [0], [0] * 8], dtype=bool)
    torque = np.full((3, 8, op3.n), 2.0)
    torque[0, 2:] = 100.0  # after its stand began
    touch = np.zeros((3, 8), dtype=bool)
    touch[:, 1:] = True
    made = make_record(
        op3,
        (3, 8),
        0.5,
        upright=upright,
        torque=torque,
        joint_vel=np.ones((3, 8, op3.n)),
        head_touch=touch,
        head_speed=np.array([[0.0], [1.5], [0.5]]) * np.eye(8)[0],
    )
    record = conclude(op3, made)
    falls = [Fall(posture=op3.standing, start_class=kind) for kind in ("prone", "prone", "left")]
    figures = summarize_rollouts(falls, record, ("prone", "left"))
    assert [figures.classes[kind].stood for kind in ("prone", "left")] == [1, 0]
    assert figures.all.n == 3
    assert figures.all.stand_time_s.median == 1.0  # end of the first good sample
    assert figures.all.head_impact_m_s.median == 0.5
    assert figures.all.rms_torque_nm.median == pytest.approx(2.0)
    assert figures.classes["left"].rms_torque_nm.median is None  # it did not get up
    assert figures.all.standing_joint_speed_rad_s.median == pytest.approx(1.0)


def test_robots_are_simulated_in_chunks_and_joined(
    op3: Robot, action: ActionSpec, monkeypatch: pytest.MonkeyPatch
):
    reports = []
    trial = try_idle(op3, action, duration=0.2)
    starts = [op3.standing] * 3
    whole = trial.run(starts)
    monkeypatch.setattr(evaluation, "CHUNK", 2)
    joined = trial.run(starts, reports.append)
    assert reports == [2, 1]
    for name in ("qpos", "target", "features", "style_error", "restarts"):
        np.testing.assert_array_equal(getattr(joined, name), getattr(whole, name))
    np.testing.assert_array_equal(joined.outcome.head_impact, whole.outcome.head_impact)
