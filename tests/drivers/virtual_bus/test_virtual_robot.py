"""The body behind a virtual bus: it moves as its twin does, however it is commanded."""

from dataclasses import replace

import numpy as np
import pytest
from bus_stories import serving
from spoiling import spoil

from drivers import Backend, Command, SafetyGuard, State, Twin
from drivers.dynamixel.control_table import OperatingMode
from drivers.errors import SetupError
from drivers.twin.simulation import Simulation
from drivers.virtual_bus.virtual_robot import VirtualRobot
from robots import Posture, Robot, load_robot
from robots.servo import RAD_PER_TICK, LimitMode

CYCLES = 100  # long enough for every joint to swing


def thrash(backend: Backend, cycles: int, torque_limit: float | None = None) -> list[State]:
    """Swing all joints about, behind the guard; return what was measured."""
    robot, states = backend.robot, []
    rng = np.random.default_rng(4)
    phase, rate = rng.uniform(0.0, 6.0, robot.n), rng.uniform(3.0, 9.0, robot.n)
    with SafetyGuard(backend) as guard:
        for k in range(cycles):
            states.append(guard.read())
            swing = 0.4 * np.sin(phase + rate * k * guard.period)
            target = robot.standing.joint_pos + swing
            guard.write(Command.position(robot, target, torque_limit))
    return states


@pytest.mark.parametrize(
    ("body", "limit_by"),
    [("op3", "current"), ("tiny", "pwm"), ("geared", "current"), ("coupled", "pwm")],
)
def test_twin_and_virtual_bus_give_one_path_whatever_turns_a_joint_and_limits_its_torque(
    body: str, limit_by: LimitMode, request: pytest.FixtureRequest
):
    assert_one_path(request.getfixturevalue(body), limit_by, 1.1)


def test_so_they_do_with_other_servos_gains_and_periods_and_on_the_ground(own_robot, op3):
    old = 'id = 2, servo = "XM430-W350"'
    spoil(own_robot, old, 'id = 2, servo = "XM430-W210", p_gain = 900')
    spoil(own_robot, "control_period = 0.008", "control_period = 0.0125")
    robot = load_robot(own_robot)
    assert robot.p_gain.tolist() == [800, 900]
    assert_one_path(robot, "current", None)
    # On the ground, its accelerometer meets the end of its range: a count turns the orientation.
    assert_one_path(op3, "current", None, replace(op3.standing, position=np.array([0.0, 0.0, 0.6])))


def assert_one_path(
    robot: Robot, limit_by: LimitMode, torque_limit: float | None, start: Posture | None = None
) -> None:
    """Swing a robot's joints on its twin and on a virtual bus: both measure the same."""
    twin = Twin(robot, start, limit_by=limit_by)
    by_twin = thrash(twin, CYCLES, torque_limit)
    with serving(robot, powered=False) as served:
        driver = served.make_driver(limit_by=limit_by)
        with driver:
            pass  # the first connection waits for the servos' power, and that takes time
        served.call(lambda: served.virtual.place(start or robot.standing))
        by_bus = thrash(driver, CYCLES, torque_limit)
    same = ("joint_pos", "joint_vel", "gyro", "orientation", "temperature", "joint_age", "alert")
    for name in same:
        ours = np.array([getattr(state, name) for state in by_bus])
        assert np.array_equal(ours, [getattr(state, name) for state in by_twin]), name
    for name in ("joint_current", "voltage"):
        ours = np.array([getattr(state, name) for state in by_bus])
        assert ours == pytest.approx(np.array([getattr(s, name) for s in by_twin]), abs=1e-6), name
    moved = np.ptp([state.joint_pos for state in by_bus], axis=0)
    assert moved.min() > 0.25, "it hardly moved: the test shows nothing"


def test_a_robot_without_torque_lies_still(op3: Robot):
    virtual, on_its_side = VirtualRobot(Simulation(op3)), np.sqrt([0.5, 0.5, 0.0, 0.0])
    at = np.array([0.0, 0.0, 0.15])
    virtual.place(replace(op3.standing, position=at, orientation=on_its_side))
    virtual.physics.advance(4.0)
    settled = virtual.simulation.joint_pos.copy()
    virtual.physics.advance(6.0)
    moved = np.abs(virtual.simulation.joint_pos - settled) / RAD_PER_TICK
    assert moved.max() < 1.0


def test_coupled_servos_turn_at_their_goals_and_their_joints_by_both(coupled: Robot):
    simulation = Simulation(coupled)
    simulation.model.opt.gravity[:] = 0.0
    virtual = VirtualRobot(simulation, powered=True)
    virtual.place(replace(coupled.standing, position=np.array([0.0, 0.0, 1.0])))
    for servo in virtual.servos:
        assert servo.write(11, bytes([OperatingMode.EXTENDED_POSITION])) == 0
        assert servo.write(64, b"\x01") == 0
        for name, value in (("profile_velocity", 40), ("goal_position", 3000)):
            item = servo.table[name]
            assert servo.write(item.address, item.encode(value)) == 0
    virtual.physics.advance(virtual.physics.time + 0.5)
    speed = [servo.peek("present_velocity") for servo in virtual.servos]
    assert speed == pytest.approx([40, 40], abs=3)
    # By hand, with 40 counts of 0.229 rev/min; the second servo sits the other way round.
    turning = np.array([[0.9, -0.5], [0.6, 0.7]]) @ virtual.simulation.joint_vel
    assert turning == pytest.approx([0.959, -0.959], abs=0.08)
    assert virtual.simulation.torque_vel == pytest.approx(turning, abs=0.02)


def test_arms_and_legs_may_hang_on_ports_of_their_own(tiny: Robot):
    assert tiny.bus is not None
    ports = {joint: (joint,) for joint in tiny.joint_names}
    assert tiny.bus.board is not None
    board = replace(tiny.bus.board, port=tiny.joint_names[0])
    robot = replace(tiny, bus=replace(tiny.bus, ports=ports, board=board))
    with serving(robot, powered=False) as served:
        assert sorted(served.virtual.chains) == ["l_hip", "r_hip"]
        physics = served.virtual.physics
        with SafetyGuard(served.make_driver()) as guard:
            begun = served.call(lambda: physics.time)
            for _ in range(60):
                guard.read()
                guard.write(Command.position(robot, np.array([0.2, -0.2])))
            reached = guard.read()
            passed = served.call(lambda: physics.time) - begun
    assert reached.joint_pos == pytest.approx([0.2, -0.2], abs=0.05)
    assert reached.age == 0.0
    assert passed == pytest.approx(60 * robot.control_period)
    with pytest.raises(SetupError, match=r"add a \[bus\] table to its robot.toml"):
        VirtualRobot(Simulation(replace(tiny, bus=None)))
