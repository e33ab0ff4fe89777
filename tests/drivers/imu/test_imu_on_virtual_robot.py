"""A robot with each kind of IMU on the virtual bus, through the driver of real robots."""

from dataclasses import replace

import numpy as np
import pytest
from bus_stories import run_json, serving
from imu_bench import KINDS
from waiting import LONGEST_WAIT, wait_until

from drivers import Command, SafetyGuard, State
from drivers.dynamixel.backend import DynamixelBackend
from drivers.errors import SetupError
from drivers.safety_guard import FaultKind
from drivers.twin.simulation import Simulation
from drivers.virtual_bus.serving.server import TimeMode
from drivers.virtual_bus.virtual_ports import VirtualPorts
from drivers.virtual_bus.virtual_robot import VirtualRobot
from robots import BoardSettings, Posture, Robot, load_robot, quaternion
from robots.kinematics import torso_orientation
from robots.transmission import Coupling

BY_ADDRESS = BoardSettings(
    id=100, port="main", imu_axes=("y", "-x", "z"), gyro_address=64, accelerometer_address=52,
    gyro_scale=0.001, accelerometer_scale=0.01,
)  # fmt: skip
TOPPLING = Posture(
    position=np.array([0.0, 0.0, 0.4]),
    orientation=quaternion.normalize(np.array([0.9, 0.3, 0.3, 0.1])),
    joint_pos=np.zeros(2),
)


def set_patience(monkeypatch: pytest.MonkeyPatch, seconds: float) -> None:
    for module in ("source", "bno055", "bno08x"):
        monkeypatch.setattr(f"drivers.imu.{module}.FIRST_SAMPLE", seconds)


@pytest.fixture(autouse=True)
def _wait_for_replies_and_not_for_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """A busy machine delays every reply: no test gives up one that is still to come."""
    set_patience(monkeypatch, LONGEST_WAIT)
    monkeypatch.setattr("drivers.imu.bno055.REPLY_TIME", LONGEST_WAIT)
    monkeypatch.setattr("drivers.service.session.SETUP_MARGIN", LONGEST_WAIT)
    monkeypatch.setattr("drivers.service.doctor.READ_SHARE", LONGEST_WAIT)


def with_imu(robot: Robot, kind: str) -> Robot:
    assert robot.bus is not None
    if kind == "board by its addresses":
        return replace(robot, bus=replace(robot.bus, board=BY_ADDRESS))
    return replace(robot, imu=KINDS[kind], bus=replace(robot.bus, board=None))


def run(driver: DynamixelBackend | SafetyGuard, cycles: int) -> State:
    for _ in range(cycles):
        state = driver.read()
        driver.write(Command.limp(driver.robot.n))
        # Until the bus has passed the period: an IMU on a line of its own is asked at once then.
        for chain in (driver.backend if isinstance(driver, SafetyGuard) else driver).chains:
            wait_until(chain.bus.port._is_handled)
    return state


@pytest.mark.parametrize(
    "kind", [*(kind for kind in KINDS if kind != "described line"), "board by its addresses"]
)
def test_the_orientation_follows_a_robot_that_topples(tiny: Robot, kind: str):
    robot = with_imu(tiny, kind)
    with serving(robot) as served:
        served.call(lambda: served.virtual.place(TOPPLING))
        with served.make_driver() as driver:
            for _ in range(2):  # falls, then rests
                state = run(driver, 120)
                simulation = served.virtual.simulation
                found = torso_orientation(robot, simulation.model, state.orientation)
                gravity, truth = quaternion.gravity_in_body(found), simulation.truth.posture
                assert gravity == pytest.approx(truth.gravity_b, abs=0.06)
            newest = 2 * robot.control_period
            wait_until(lambda: run(driver, 1).imu_age <= newest)


@pytest.mark.parametrize("kind", ["BNO08x UART-RVC", "BNO055 on I2C"])
def test_the_guard_switches_torque_off_when_the_imu_falls_silent(tiny: Robot, kind: str):
    with serving(with_imu(tiny, kind)) as served, SafetyGuard(served.make_driver()) as guard:
        run(guard, 10)
        assert guard.fault is None and served.virtual.imu is not None
        served.call(lambda: setattr(served.virtual.imu, "alive", False))
        run(guard, 60)
        assert guard.fault is not None and guard.fault.kind is FaultKind.LOST_IMU


def test_the_imu_of_a_held_robot_is_not_frozen_where_servos_turn_faster_than_joints(tiny: Robot):
    """Its bytes repeat, as in a person's hands; the joint turns by 0.6 rad/s, its servos by 1.4."""
    coupling = Coupling(joints=(0, 1), matrix=np.array([[2.4, -1.7], [2.4, 1.7]]))
    robot = replace(with_imu(tiny, "BNO055 on I2C"), couplings=(coupling,))
    in_the_air = replace(robot.standing, position=robot.standing.position + np.array([0, 0, 0.5]))
    with serving(robot) as served:
        served.call(lambda: served.virtual.hold(in_the_air))
        with served.make_driver() as driver:
            target = driver.read().joint_pos.copy()
            for _ in range(100):
                target[0] += 0.6 * robot.control_period
                driver.write(Command.position(robot, target))
                state = driver.read()
            assert np.abs(state.joint_vel).max() > 0.4
            assert state.imu_age == 0.0


def test_a_board_may_power_the_servos_of_a_robot_whose_imu_is_elsewhere(tiny: Robot):
    robot = replace(tiny, imu=KINDS["BNO08x on I2C"])
    with serving(robot, powered=False) as served, served.make_driver() as driver:
        assert all(servo.powered for servo in served.virtual.servos)
        served.call(lambda: setattr(served.virtual.board, "alive", False))
        assert run(driver, 30).imu_age == 0.0
    with pytest.raises(SetupError, match=r"its serial port is not named; set imu[.]port"):
        DynamixelBackend(with_imu(tiny, "serial line"), {"main": "p"})


class Metronome:
    """A clock that only sleeping advances, and a sleep that lets the virtual bus do its work."""

    def __init__(self, ports: VirtualPorts) -> None:
        self._ports, self._now = ports, 0.0

    def monotonic(self) -> float:
        return self._now

    def sleep(self, duration: float) -> None:
        self._now += duration
        self._ports.main.call(lambda: None)


def test_the_doctor_names_the_imu_and_counts_its_samples(own_robot, capsys, monkeypatch):
    file = own_robot / "robot.toml"
    file.write_text(file.read_text() + '\n[imu]\nkind = "bno055"\n')
    virtual = VirtualRobot(Simulation(load_robot(own_robot)), powered=True)
    with VirtualPorts(virtual, time_mode=TimeMode.LOCK_STEP) as ports:
        monkeypatch.setattr("drivers.service.doctor.time", Metronome(ports))
        given = [f"{name}={path}" for name, path in ports.paths.items()]
        arguments = ("doctor", "--robot", str(own_robot), "--port", ",".join(given))
        code, message = run_json(*arguments, capsys=capsys)
        assert code == 0 and message["imu"].startswith("IMU BNO055 on ")
        assert message["imu_rate_hz"] > 10.0
        assert message["accelerometer_m_s2"][2] == pytest.approx(9.81, abs=0.05)
        ports.main.call(lambda: setattr(virtual.imu, "alive", False))
        set_patience(monkeypatch, 0.05)
        code, message = run_json(*arguments, capsys=capsys)
    assert code == 3
    assert any(f["device"].startswith("IMU BNO055") for f in message["findings"])
