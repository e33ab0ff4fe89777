"""Training's simulation on mujoco-warp: delays, sensing and checkpoints as with MuJoCo."""

import numpy as np
import pytest

pytest.importorskip("mujoco_warp", reason="needs the `warp` extra: make test-warp")

from humanoid_getup.simulation.physics_engine import MUJOCO, PhysicsEngine
from humanoid_getup.simulation.world import World
from robots import Robot
from robots.kinematics import place
from sim2real.environment.env_options import ALL
from sim2real.environment.training_simulation import TrainingSim

pytestmark = pytest.mark.warp
CYCLES, N = 6, 4
WARP = PhysicsEngine("warp", "cpu")
SENSED = ("gravity", "gyro", "joint_pos", "joint_vel")


def make_sim(op3: Robot, world: World, physics: PhysicsEngine) -> TrainingSim:
    """Robots that differ in all parameters, delays included, and fall freely."""
    sim = TrainingSim(world, N, cycles=CYCLES, threads=1, physics=physics)
    sim.set_parameters(sim.everyone, ALL.draw(world, N, np.random.default_rng(0)))
    qpos = np.tile(place(op3, world.model, op3.standing), (N, 1))
    qpos[:, op3.layout(world.model).root_qpos + 2] += 5.0
    sim.place(sim.everyone, qpos)
    return sim


def swing(op3: Robot, sim: TrainingSim, steps: int) -> None:
    rest = np.tile(op3.standing.joint_pos, (N, 1))
    for step in range(steps):
        sim.follow(rest + 0.3 * (step % 2), rest + 0.3 * ((step + 1) % 2))


def test_robots_that_differ_move_and_sense_as_in_mujoco(op3, delayed_world):
    by_mujoco, by_warp = (make_sim(op3, delayed_world, physics) for physics in (MUJOCO, WARP))
    for sim in (by_mujoco, by_warp):
        swing(op3, sim, 4)
    delays = by_mujoco.parameters.sensor_delay
    assert len(np.unique(delays)) > 2
    assert np.ptp(by_mujoco.qpos[:, 7:], axis=0).max() > 0.05
    assert by_warp.qpos == pytest.approx(by_mujoco.qpos, abs=1e-3)
    for name in SENSED:
        true = getattr(by_mujoco.sense(), name)
        assert getattr(by_warp.sense(), name) == pytest.approx(true, abs=0.02), name


def test_a_restored_simulation_continues_to_the_bit_on_the_cpu(op3, delayed_world):
    sim = make_sim(op3, delayed_world, WARP)
    swing(op3, sim, 2)
    state = sim.save_state()
    other = TrainingSim(delayed_world, N, cycles=CYCLES, threads=1, physics=WARP)
    other.restore_state(state)
    for one in (sim, other):
        swing(op3, one, 2)
    assert np.array_equal(sim.qpos, other.qpos)
    for name in SENSED:
        assert np.array_equal(getattr(sim.sense(), name), getattr(other.sense(), name))
