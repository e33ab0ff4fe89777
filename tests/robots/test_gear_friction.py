"""Friction of gears under load, and a supply behind a resistance, by numbers from the hand."""

from dataclasses import replace

import numpy as np
import pytest

from drivers import Command, Twin
from drivers.twin.simulation import Simulation
from humanoid_getup.simulation.vectorized_simulation import VecSim
from humanoid_getup.simulation.world import World
from robots import Robot
from robots.bench import Load, make_bench, make_bench_joint
from robots.description.servo_catalog import servo_models
from robots.gear_friction import GearFriction
from robots.kinematics import place
from robots.torque_limit import limit_servos

FIGURES = {
    "friction": 0.1,
    "load_friction": 0.2,
    "load_friction_slope": 0.05,
    "stiction": 0.1,
    "stiction_speed": 0.5,
}


def load_gears(robot: Robot, **figures: float) -> Robot:
    """Return a robot whose servos have other figures."""
    joints = tuple(
        replace(j, servo=replace(j.servo, model=replace(j.servo.model, **figures)))
        for j in robot.joints
    )
    return replace(robot, joints=joints)


def test_friction_grows_with_the_torque_of_the_motor(op3: Robot):
    """2 N·m at rest: 0.1 + 2 (0.2 + 0.05 * 2 + 0.1) = 0.9; at 0.5 rad/s stiction is 0.1 / e."""
    robot = load_gears(op3, **FIGURES)
    gears = GearFriction(robot, World(robot).model)
    torque, speed = np.full(robot.n, -2.0), np.zeros(robot.n)
    assert gears.compute(torque, speed) == pytest.approx(np.full(robot.n, 0.9))
    moving = 0.1 + 2.0 * (0.2 + 0.1 + 0.1 / np.e)
    assert gears.compute(torque, speed + 0.5) == pytest.approx(np.full(robot.n, moving))
    assert list(gears.in_joints) == list(range(robot.n))
    assert GearFriction(op3, World(op3).model).is_constant


def test_friction_of_a_geared_servo_is_that_at_its_joint(geared: Robot):
    """Gear 1.2, 1.2 N·m and 0.5 / 1.2 rad/s at the joint: 1 N·m and 0.5 rad/s at the servo."""
    robot = load_gears(geared, **FIGURES)
    gears = GearFriction(robot, World(robot).model)
    friction = gears.compute(np.array([1.2, 0.0]), np.array([0.5 / 1.2, 0.0]))
    at_servo = 0.1 + 0.2 + 0.05 + 0.1 / np.e
    assert friction == pytest.approx([1.2 * at_servo, 10 / 11 * 0.1])


def test_the_tendon_of_coupled_joints_has_the_friction_of_its_servo(coupled: Robot):
    robot = load_gears(coupled, **FIGURES)
    simulation = Simulation(robot)
    simulation.drive(np.array([0.5, -0.2]), limit_servos(robot, robot.max_torque, "current"))
    simulation.step(20)
    load, speed = np.abs(simulation.data.actuator_force), np.abs(simulation.data.actuator_velocity)
    assert load.min() > 0.01
    assert speed.min() > 0.01
    expected = 0.1 + load * (0.2 + 0.05 * load + 0.1 * np.exp(-speed / 0.5))
    assert simulation.model.tendon_frictionloss == pytest.approx(expected)
    assert not simulation.model.dof_frictionloss[-robot.n :].any()


def test_the_data_sheet_is_what_friction_leaves_of_an_identified_motor():
    assert servo_models()["XL330-M288"].top_speed == pytest.approx(10.79, rel=0.01)


def stall(voltage: float) -> float:
    """Drive a servo of a bench against its end with all its PWM; return its torque [N·m]."""
    joint = make_bench_joint(servo_models()["XL330-M288"], 1, lower=-0.1, upper=0.1)
    bench = make_bench([joint], baud=1_000_000)
    simulation = Simulation(bench, voltage=voltage)
    simulation.drive(np.array([3.0]), limit_servos(bench, bench.max_torque, "pwm"))
    simulation.step(500)
    return float(simulation.data.actuator_force[0])


def test_stall_torque_is_that_of_the_supply_that_is_there():
    nominal = servo_models()["XL330-M288"].stall_torque
    assert stall(5.0) == pytest.approx(nominal, rel=1e-3)
    assert stall(7.4) == pytest.approx(nominal * 7.4 / 5.0, rel=1e-3)
    assert stall(4.0) == pytest.approx(nominal * 4.0 / 5.0, rel=1e-3)


def test_a_loaded_joint_with_stiff_friction_does_not_creep():
    """A mass of 0.2 kg at 0.1 m, 45° off, is held by 0.3 N·m of friction; 0.14 are needed."""
    model = replace(servo_models()["XL330-M288"], friction=0.3)
    bench = make_bench(
        [make_bench_joint(model, 1)], baud=1_000_000, loads=[Load(mass=0.2, arm=0.1)]
    )
    start = replace(bench.standing, joint_pos=np.array([np.pi / 4.0]))
    twin = Twin(bench, start, without_imu=True)
    with twin:
        for _ in range(200):
            twin.write(Command.limp(1))
    assert twin.truth.qpos[-1] == pytest.approx(np.pi / 4.0, abs=2e-3)


@pytest.mark.parametrize(("resistance", "figures"), [(0.2, {}), (0.0, FIGURES), (0.2, FIGURES)])
def test_vectorized_simulation_follows_load_once_a_period(
    op3: Robot, resistance: float, figures: dict[str, float]
):
    """Behind a resistance they agree to the bit; friction follows each step in the twin alone."""
    robot = replace(load_gears(op3, **figures), supply_resistance=resistance)
    world = World(robot)
    count = 60
    targets = np.tile(robot.standing.joint_pos, (count, 1))
    targets[20:, ::3] -= np.linspace(0.0, 0.6, count - 20)[:, None]
    vectorized, simulation = VecSim(world, 1), Simulation(world)
    vectorized.place(np.arange(1), place(robot, world.model, robot.standing)[None])
    steps, voltages = simulation.steps_per_period, []
    vectorized.advance(targets[None], steps)
    drive = limit_servos(robot, robot.max_torque, robot.limit_by)
    for target in targets:
        simulation.drive(target, drive)
        simulation.step(steps)
        simulation.update_sensors(robot.control_period)
        voltages.append(simulation.voltage)
    apart = np.abs(vectorized.qpos[0] - simulation.data.qpos).max()
    assert apart < 0.02 if figures else apart == 0.0
    assert (min(voltages) < robot.supply_voltage - 0.1) is (resistance > 0.0)


def test_a_supply_sags_by_its_resistance_times_the_current(op3: Robot):
    """One XM430-W350 at 2 N·m and rest: 2 / 4.1 * 2.3 A at a share 2 / 4.1 of the supply."""
    robot = replace(op3, supply_resistance=0.5)
    torque = np.zeros(robot.n)
    torque[0] = 2.0
    current = 2.0 / 4.1 * 2.3 * (2.0 / 4.1)
    sagged = robot.sag(12.0, torque, np.zeros(robot.n))
    assert sagged == pytest.approx(12.0 - 0.5 * current)
