"""The twin is the vectorized simulation of one world: the same bits, whatever limits servos."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from drivers import Command, Twin
from drivers.servo_units import ServoUnits
from humanoid_getup.experiments.disturbances import Scenarios
from humanoid_getup.experiments.rollouts import play
from humanoid_getup.motions.motion import Motion
from humanoid_getup.simulation.domain_parameters import DomainParameters
from humanoid_getup.simulation.vectorized_simulation import VecSim
from humanoid_getup.simulation.world import World
from robots import Posture, Robot
from robots.kinematics import place
from robots.servo import LimitMode


def load_motion(robot: Robot, name: str) -> Motion:
    return Motion.load(Path(robot.folder) / "motions" / f"{name}.npz")


def sample_targets(robot: Robot, motion: Motion) -> np.ndarray:
    """Sample a motion's targets once a control period, in whole ticks as servos take them."""
    times = np.arange(motion.time[0], motion.time[-1], robot.control_period)
    return ServoUnits(robot).round_goal(motion.sample(times))


def play_on_twin(twin: Twin, start: Posture, targets: np.ndarray, limit: float) -> np.ndarray:
    twin.place(start)
    went = []
    with twin:
        for target in targets:
            twin.write(Command.position(twin.robot, target, torque_limit=limit))
            went.append(twin.truth.qpos)
    return np.array(went)


@pytest.mark.parametrize(
    ("limit", "limit_by"), [(4.1, "current"), (2.0, "current"), (2.0, "pwm"), (2.0, "ideal")]
)
def test_twin_and_vectorized_simulation_agree_to_the_bit(
    world: World, op3: Robot, limit: float, limit_by: LimitMode
):
    """Joint by joint, over a whole stored motion, also on the twin's own ground."""
    motion = load_motion(op3, "prone_push_up_fast")
    start, targets = motion.posture(0), sample_targets(op3, motion)
    qpos = place(op3, world.model, start)
    parameters = DomainParameters.nominal(world, 1, torque_limit=limit, limit_by=limit_by)
    trace = play(world, Scenarios(starts=qpos[None], parameters=parameters), targets[None])
    for model in (world.model, None):
        twin = Twin(World(op3, model=model), limit_by=limit_by)
        went = play_on_twin(twin, start, targets, limit)
        assert len(went) > 150
        assert np.array_equal(trace.qpos[0], went)


def test_limits_of_one_world_leave_the_others_as_they_are(world: World, op3: Robot):
    """Set after the others, in a batch of three, a world moves as it does alone."""
    motion = load_motion(op3, "supine_sit_up_gentle")
    targets = sample_targets(op3, motion)[None, :60]
    start = place(op3, world.model, motion.posture(0))[None]
    parameters = DomainParameters.nominal(world, 1, torque_limit=1.5, limit_by="pwm")
    parameters.mass[:] = 1.2
    together, alone = VecSim(world, 3), VecSim(world, 1)
    together.set_parameters(np.array([1]), parameters)
    alone.set_parameters(np.array([0]), parameters)
    for sim in (together, alone):
        sim.place(sim.everyone, np.repeat(start, sim.n, axis=0))
        sim.advance(np.repeat(targets, sim.n, axis=0), 4)
    plain = VecSim(world, 1)
    plain.place(plain.everyone, start)
    plain.advance(targets, 4)
    assert np.array_equal(together.qpos[1], alone.qpos[0])
    assert np.array_equal(together.qpos[[0, 2]], np.repeat(plain.qpos, 2, axis=0))
    assert not np.array_equal(alone.qpos, plain.qpos)


@pytest.mark.parametrize("limit_by", ["current", "pwm"])
def test_coupled_joints_move_as_on_the_twin_to_the_bit(coupled: Robot, limit_by: LimitMode):
    world = World(coupled)
    cycles = np.arange(80)[:, None] * coupled.control_period
    swing = np.array([0.4, 0.3]) * np.sin(np.array([5.0, 7.0]) * cycles)
    targets = ServoUnits(coupled).round_goal(swing)
    by_twin = play_on_twin(Twin(world, limit_by=limit_by), coupled.standing, targets, 1.0)
    qpos = place(coupled, world.model, coupled.standing)
    parameters = DomainParameters.nominal(world, 1, torque_limit=1.0, limit_by=limit_by)
    played = play(world, Scenarios(starts=qpos[None], parameters=parameters), targets[None])
    assert np.array_equal(played.qpos[0], by_twin)
    assert np.ptp(by_twin[:, -2:], axis=0).min() > 0.1


def test_rotors_and_friction_of_coupled_servos_are_randomized_too(coupled: Robot):
    world = World(coupled)
    sim = VecSim(world, 2)
    heavy = replace(
        sim.parameters, armature=np.array([1.0, 2.0]), friction_loss=np.array([1.0, 3.0])
    )
    sim.set_parameters(sim.everyone, heavy)
    assert sim.batch.expand("tendon_armature") == pytest.approx(
        np.array([[0.0025, 0.0025], [0.005, 0.005]])
    )
    assert sim.batch.expand("tendon_frictionloss")[:, 0] == pytest.approx([0.105, 0.315])
