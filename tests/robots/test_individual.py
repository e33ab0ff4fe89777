"""What sets a robot apart acts in twin, vectorized simulation and disturbances alike."""

import shutil
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
from paths import TINY

from drivers.twin.simulation import Simulation
from humanoid_getup.experiments.disturbances import USUAL
from humanoid_getup.simulation.vectorized_simulation import VecSim
from humanoid_getup.simulation.world import World
from robots import Robot, RobotError, load_robot, quaternion
from robots.individual import IDENTIFIED_FILE, Individual
from robots.kinematics import imu_in_torso, place
from robots.torque_limit import limit_servos

OTHER = Individual(
    robot="tiny",
    strength=0.8,
    friction=1.5,
    mass=1.1,
    delay=0.009,
    com=0.004,
    load_friction=0.1,
    imu_tilt=(0.1, 0.0, 0.0),
    supply_resistance=0.2,
    intervals={"mass": (1.05, 1.15), "delay": (0.008, 0.01)},
)


def swing(robot: Robot, cycles: int = 20) -> tuple[Simulation, VecSim]:
    """Send the same targets, ever farther from the stance, in both simulations."""
    world = World(robot)
    alone, many = Simulation(world), VecSim(world, 2)
    alone.place(robot.standing)
    many.place(many.everyone, np.tile(place(robot, world.model, robot.standing), (2, 1)))
    drive = limit_servos(robot, robot.max_torque, "pwm", gain_scale=np.ones(robot.n))
    for k in range(cycles):
        target = robot.standing.joint_pos + 0.02 * k
        alone.drive(target, drive)
        alone.step(alone.steps_per_period)
        many.advance(np.tile(target, (2, 1, 1)), alone.steps_per_period)
    return alone, many


@pytest.mark.parametrize("own", [Individual(), replace(OTHER, supply_resistance=None)])
def test_twin_and_vectorized_simulation_agree(tiny: Robot, own: Individual):
    alone, many = swing(tiny.with_individual(own))
    assert many.qpos[0] == pytest.approx(alone.data.qpos, abs=2e-3)


def test_figures_of_servos_change_how_a_robot_moves(tiny: Robot):
    usual = swing(tiny)[0].joint_pos
    for name in ("strength", "friction", "delay", "load_friction"):
        own = Individual(**{name: getattr(OTHER, name)})
        moved = swing(tiny.with_individual(own))[0].joint_pos
        assert np.abs(moved - usual).max() > 1e-4, name


def test_targets_act_late_by_the_delay_and_not_those_before_torque(tiny: Robot):
    late, usual = (
        Simulation(tiny.with_individual(Individual(delay=delay))) for delay in (0.016, 0.0)
    )
    drive = limit_servos(tiny, tiny.max_torque, "pwm", gain_scale=np.ones(tiny.n))
    for simulation in (late, usual):
        simulation.place(tiny.standing)
        simulation.drive(tiny.standing.joint_pos + 1.0, replace(drive, torque=0.0 * drive.torque))
        simulation.step(20)  # limp: what was sent meanwhile is forgotten
        simulation.drive(simulation.joint_pos, drive)
        simulation.step(4)
    assert late.joint_pos == pytest.approx(usual.joint_pos, abs=1e-3)
    model, before = late.model, late.joint_pos
    late.drive(before + 0.2, drive)
    late.step(round(0.014 / model.opt.timestep))
    assert late.joint_pos == pytest.approx(before, abs=2e-3)
    late.step(round(0.02 / model.opt.timestep))
    assert np.all(late.joint_pos > before + 0.01)


def test_a_delay_of_much_less_than_a_physics_step_is_none(tiny: Robot):
    robot = tiny.with_individual(Individual(delay=1e-4))
    assert swing(robot)[0].joint_pos == pytest.approx(swing(tiny)[0].joint_pos, abs=1e-12)


def test_model_and_figures_are_those_of_the_individual(tiny: Robot):
    robot = tiny.with_individual(OTHER)
    usual, own = tiny.spec().compile(), robot.spec().compile()
    assert own.body_mass == pytest.approx(1.1 * usual.body_mass)
    assert own.body_inertia == pytest.approx(1.1 * usual.body_inertia)
    shift = own.body(tiny.torso).ipos - usual.body(tiny.torso).ipos
    assert shift == pytest.approx([0.004, 0.0, 0.0])
    assert robot.find_stall(12.0) == pytest.approx(0.8 * tiny.find_stall(12.0))
    assert robot.supply_resistance == 0.2 and tiny.supply_resistance == 0.0
    turned = quaternion.multiply(
        quaternion.inverse(imu_in_torso(tiny, usual)), imu_in_torso(robot, own)
    )
    assert turned == pytest.approx([np.cos(0.05), np.sin(0.05), 0.0, 0.0])
    assert mujoco.mj_stateSize(own, mujoco.mjtState.mjSTATE_HISTORY) > 0


def test_disturbances_are_as_wide_as_the_intervals(tiny: Robot):
    rng = np.random.default_rng(1)
    world = World(tiny.with_individual(OTHER))
    mass = USUAL.draw(world, 400, rng).mass[:, 0]
    assert 1.05 / 1.1 < mass.min() < 0.96 and 1.04 < mass.max() < 1.15 / 1.1
    assert np.ptp(USUAL.draw(World(tiny), 9, rng).mass) == 0.0


def test_the_file_is_read_beside_the_calibration(tmp_path: Path, tiny: Robot):
    own = Path(shutil.copytree(TINY, tmp_path / "own"))
    OTHER.save(own / IDENTIFIED_FILE, ["From flights:", "a.mcap: 12ab"])
    assert (own / IDENTIFIED_FILE).read_text().startswith("# From flights:\n# a.mcap: 12ab\n")
    assert load_robot(own).individual == OTHER
    assert str(OTHER).startswith("strength 0.8, friction 1.5, mass 1.1, delay 0.009, ")
    assert Individual().is_as_described and str(Individual(mass=1.0)) == ""
    assert load_robot(own, individual=Individual()).supply_resistance == tiny.supply_resistance
    for text, problem in (
        ('robot = "op3"', "it is of robot 'op3', expected 'tiny'"),
        ('robot = "tiny"\nmass = 9.0', "mass is 9, expected 0.2 to 5"),
        ('robot = "tiny"\n[intervals]\nmass = [2.0, 1.0]', "expected it about mass, 1"),
        ('robot = "tiny"\n[intervals]\nmass = [2.0]', "intervals.mass"),
        ('robot = "tiny"\nimu_tilt = [5.0, 0.0, 0.0]', "expected angles in rad"),
        ('robot = "tiny"\n[intervals]\nsize = [1.0, 2.0]', "intervals.size is not known"),
        ('robot = "tiny"\nimu_tilt = [1.0]', "imu_tilt"),
        ('robot = "tiny"\n[intervals]\nsupply_resistance = [0.1, 0.2]', "is not known"),
    ):
        (own / IDENTIFIED_FILE).write_text(text)
        with pytest.raises(RobotError, match="make a new one: getup identify robot") as refused:
            load_robot(own)
        assert problem in str(refused.value) and "\n" not in str(refused.value)


def test_some_of_many_robots_may_be_stepped(tiny: Robot):
    world = World(tiny.with_individual(Individual(load_friction=0.1)))
    many = VecSim(world, 3)
    many.place(many.everyone, np.tile(place(tiny, world.model, tiny.standing), (3, 1)))
    some = np.array([0, 2])
    before = many.qpos
    many.advance(np.full((2, 3, tiny.n), 0.3), 4, ids=some)
    assert many.diverged.shape == (3,) and not many.diverged.any()
    assert np.array_equal(many.qpos[1], before[1]) and not np.array_equal(many.qpos[2], before[2])
