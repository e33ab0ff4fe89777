"""One rollout has one outcome: recorded by a twin, by rollouts, and by training's simulation."""

import numpy as np
import pytest

from drivers import Command, Twin
from humanoid_getup.experiments.disturbances import Scenarios
from humanoid_getup.experiments.falls import settle_posture
from humanoid_getup.experiments.judging.judge import GroundTruthJudge
from humanoid_getup.experiments.judging.outcome import Outcome
from humanoid_getup.experiments.judging.record import join_records
from humanoid_getup.experiments.rollouts import Experiment, play
from humanoid_getup.motions.motion import hold_last
from humanoid_getup.motions.motion_database import load_database
from humanoid_getup.scenes.scene import FLAT_SCENE
from humanoid_getup.simulation.world import World
from robots import Robot
from robots.kinematics import place, read_posture
from robots.quaternion import Array

HELD = 480  # control periods after the last target
OF_SERVOS = (
    "stood",
    "stand_time",
    "peak_torque",
    "peak_braking_torque",
    "torque_use",
    "rms_torque",
    "peak_velocity",
    "saturation",
    "limit_violations",
)
"""Figures of a state at the sample, in every simulation."""


@pytest.fixture(scope="module")
def run(op3: Robot, world: World) -> tuple[Array, Array, Outcome]:
    """A stored motion on a twin: where it began, the targets as they were sent, its outcome."""
    motion = next(m for m in load_database(op3).motions if m.name == "squat_to_stand")
    start = read_posture(op3, world.model, settle_posture(world, motion.posture(0)))
    targets = hold_last(motion.joint_target, len(motion.joint_target) + HELD)
    twin = Twin(world)
    twin.place(start)
    judge = GroundTruthJudge(twin.simulation, None)
    with twin:
        sent = [twin.write(Command.position(op3, target)).joint_pos for target in targets]
    return place(op3, world.model, start), np.array(sent), judge.conclude()


@pytest.fixture(scope="module")
def rollout(world: World, run: tuple[Array, Array, Outcome]) -> Outcome:
    start, targets, _ = run
    return Outcome(play(world, Scenarios.nominal(world, start), targets[None]).take(0), world.robot)


def test_a_rollout_ends_as_it_does_on_the_twin(run: tuple[Array, Array, Outcome], rollout: Outcome):
    _, _, twin = run
    assert twin.stood
    np.testing.assert_array_equal(rollout.qpos, twin.qpos)
    for figure in OF_SERVOS:
        np.testing.assert_array_equal(getattr(rollout, figure), getattr(twin, figure), figure)
    # A rollout knows sites and contacts as they were one physics step before.
    for figure in ("overlap", "neck_delta_v", "progress"):
        assert getattr(rollout, figure) == pytest.approx(getattr(twin, figure), abs=0.02), figure


def test_an_early_stop_changes_no_figure_of_the_way_up(world, run, rollout):
    start, targets, _ = run
    record = play(world, Scenarios.nominal(world, start), targets[None, :-HELD], stop_early=True)
    early = Outcome(record.take(0), world.robot)
    assert early.record.cycles < len(targets)
    for figure in ("stood", "stand_time", "rms_torque", "neck_delta_v", "progress"):
        np.testing.assert_array_equal(getattr(early, figure), getattr(rollout, figure), figure)


@pytest.mark.train
def test_training_judges_a_rollout_as_it_is(op3, run, rollout):
    physics = pytest.importorskip("sim2real.environment.training_simulation")
    from sim2real.environment.training_world import build_training_world

    start, targets, _ = run
    training = build_training_world(op3, FLAT_SCENE, op3.choose_timestep(0.002))
    sim = physics.TrainingSim(training, 1, cycles=1)
    steps = (sim.make_targets(target[None], target[None]) for target in targets)
    experiment, nominal = Experiment(training, sim=sim), Scenarios.nominal(training, start)
    records = list(experiment.play_pieces(nominal, lambda: next(steps, None)))
    trained = Outcome(join_records(records).take(0), op3)
    np.testing.assert_array_equal(trained.qpos, rollout.qpos)
    for figure in (*OF_SERVOS, "neck_delta_v", "progress"):
        np.testing.assert_array_equal(getattr(trained, figure), getattr(rollout, figure), figure)
