"""What every backend promises. A new backend joins ``BACKENDS`` and passes it all."""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import replace

import numpy as np
import pytest
from bus_stories import serving
from tiny_robots import with_servos

from drivers import Backend, Command, SafetyGuard, Twin
from drivers.dynamixel.configuration import full_scale
from drivers.dynamixel.control_table import table_named
from drivers.errors import DriverError, NotConnectedError
from drivers.serial_port import SDK
from drivers.twin.device_models import CURRENT_STEP
from robots import ImuSettings, Robot
from robots.description.servo_catalog import servo_models

Make = Callable[[Robot], AbstractContextManager[Backend]]


@contextmanager
def virtual(
    robot: Robot, wrap: Callable[[Backend], Backend] = lambda backend: backend
) -> Iterator[Backend]:
    """The real driver, its port, and servos that speak the protocol with physics behind them."""
    with serving(robot, powered=False) as served:
        yield wrap(served.make_driver())


@contextmanager
def by_sdk(robot: Robot) -> Iterator[Backend]:
    """The driver over a port that the maker's own library opens."""
    with serving(robot, powered=False) as served:
        yield served.make_driver(SDK)


BACKENDS: dict[str, Make] = {
    "twin": lambda robot: nullcontext(Twin(robot)),
    "guarded twin": lambda robot: nullcontext(SafetyGuard(Twin(robot))),
    "virtual bus": virtual,
    "guarded virtual bus": lambda robot: virtual(robot, SafetyGuard),
    "sdk": by_sdk,
}


ROBOTS = ("tiny", "geared", "coupled")
PLAIN = ("AX-12A", "MX-28(1.0)", "XL-320", "STS3215-C018")
"""Servos without modes and watchdog; on a bus alone, for a twin rounds as an X servo does."""
CASES = [
    *((robot, backend) for robot in ROBOTS for backend in BACKENDS if backend != "sdk"),
    ("tiny", "sdk"),
    *((servo, backend) for servo in PLAIN for backend in ("virtual bus", "guarded virtual bus")),
]


def with_plain(tiny: Robot, name: str) -> Robot:
    """The tiny robot with servos of another type; its IMU is on a line of its own then."""
    model = servo_models()[name]
    zeros = (model.middle_tick, model.middle_tick // 2)
    assert tiny.bus is not None
    return replace(
        with_servos(tiny, *({"model": model, "zero_ticks": zero} for zero in zeros)),
        bus=replace(tiny.bus, board=None),
        imu=ImuSettings(kind="bno055", connection="i2c"),
        supply_voltage=model.nominal_voltage,
        limit_by="pwm",
    )


@pytest.fixture(params=CASES, ids="-".join)
def case(request: pytest.FixtureRequest) -> tuple[str, str]:
    return request.param


@pytest.fixture
def robot(case: tuple[str, str], tiny: Robot, request: pytest.FixtureRequest) -> Robot:
    name = case[0]
    return with_plain(tiny, name) if name in PLAIN else request.getfixturevalue(name)


@pytest.fixture
def backend(case: tuple[str, str], robot: Robot) -> Iterator[Backend]:
    with BACKENDS[case[1]](robot) as backend:
        yield backend


def turn(backend: Backend, command: Command, cycles: int = 1) -> Command:
    for _ in range(cycles):
        backend.read()
        sent = backend.write(command)
    return sent


def test_it_works_only_while_connected_and_connecting_and_closing_twice_is_harmless(backend):
    with pytest.raises(NotConnectedError):
        backend.read()
    backend.connect()
    backend.connect()
    assert backend.read().is_valid
    backend.close()
    backend.close()
    with pytest.raises(NotConnectedError):
        backend.write(Command.limp(backend.robot.n))


def test_a_measurement_is_whole_of_the_robots_shape_and_one_for_each_period(backend: Backend):
    states = []
    with backend:
        for _ in range(4):
            states.append(backend.read())
            again = backend.read()
            assert again.time == states[-1].time
            assert np.array_equal(again.joint_pos, states[-1].joint_pos)
            backend.write(Command.limp(backend.robot.n))
    for state in states:
        for name in ("joint_pos", "joint_vel", "joint_current", "temperature"):
            assert getattr(state, name).shape == (backend.robot.n,), name
        assert state.gyro.shape == (3,)
        assert np.linalg.norm(state.orientation) == pytest.approx(1.0)
        assert state.is_valid
    assert np.diff([state.time for state in states]) == pytest.approx([backend.period] * 3)


def test_the_robot_goes_where_it_is_sent_and_a_measurement_stays_as_it_was(backend: Backend):
    target = np.array([0.2, -0.2])
    with backend:
        state = backend.read()
        before = [np.copy(value) for value in vars(state).values()]
        turn(backend, Command.position(backend.robot, target), 60)
        reached = backend.read().joint_pos
    assert reached == pytest.approx(target, abs=0.05)
    assert before
    assert all(np.array_equal(a, b) for a, b in zip(before, vars(state).values(), strict=True))


def test_a_sound_command_is_sent_as_it_is(backend: Backend):
    command = Command(
        joint_pos=np.array([0.01, -0.01]),
        gain_scale=np.array([0.5, 1.0]),
        torque_limit=np.array([1.0, 2.0]),
        pwm_limit=np.array([1.0, 0.8]),
    )
    with backend:
        sent = turn(backend, command)
    # In the servos' resolution: whole ticks, 1/800 of the gain, a count of the current.
    robot = backend.robot
    tick = max(joint.servo.rad_per_tick for joint in robot.joints)
    table = table_named(robot.joints[0].servo.model.name)
    count = float((robot.current_step * robot.torque_per_ampere).max())
    torque = command.torque_limit
    if robot.limit_by == "pwm":  # one register for both limits
        torque = np.minimum(torque, command.pwm_limit * robot.max_torque)
        count = float(robot.max_torque.max()) / full_scale(table)
    assert sent.joint_pos == pytest.approx(command.joint_pos, abs=0.5 * tick + 1e-12)
    assert sent.gain_scale == pytest.approx(command.gain_scale, abs=1.0 / 800)
    assert np.all(sent.torque_limit <= command.torque_limit)
    assert sent.torque_limit == pytest.approx(torque, abs=count)
    assert np.all(sent.pwm_limit <= command.pwm_limit)


def test_a_pwm_limit_slows_a_servo_down(backend: Backend):
    target = np.array([0.3, -0.3])
    # A fifth of the supply is too little for the weakest of these servos to lift a leg.
    share = 0.2 if backend.robot.max_torque.min() > 1.0 else 0.6
    slow = Command.position(backend.robot, target, pwm_limit=share)
    with backend:
        sent = turn(backend, slow)
        assert sent.pwm_limit == pytest.approx(share, abs=1.0 / 885)
        speeds = []
        for _ in range(12):
            turn(backend, slow)
            at_servo = backend.robot.transmission.to_servo(backend.read().joint_vel)
            speeds.append(np.abs(at_servo).max())
    # A share of the supply turns the unloaded motor at that share of its no-load speed at most.
    model = backend.robot.joints[0].servo.model
    step = table_named(model.name)["present_velocity"].scale
    assert 0.0 < max(speeds) <= share * model.no_load_speed + step


def test_no_servo_exceeds_its_torque_limit(backend: Backend):
    # At the servo of an XM430 1.783 N·m/A: 4.1 N·m at 2.3 A, the stall figures.
    per_ampere = backend.robot.joints[0].servo.model.torque_per_ampere
    command = Command.position(backend.robot, np.array([1.0, -1.0]), torque_limit=0.2)
    with backend:
        for _ in range(30):
            turn(backend, command)
            servo_torque = backend.read().joint_current * per_ampere
            torque = servo_torque * [joint.servo.gear for joint in backend.robot.joints]
            assert np.all(np.abs(torque) <= 0.2 + CURRENT_STEP * 1.2 * per_ampere)
    assert np.abs(torque).max() > 0.1, "the limit was never reached: the test shows nothing"


def test_a_command_that_is_no_command_moves_nothing(backend: Backend):
    bad = Command.position(backend.robot, np.array([np.nan, 0.0]))
    with backend:
        try:
            assert turn(backend, bad).is_limp
        except DriverError as error:
            assert "nan" in str(error)


def test_a_robot_is_limp_when_told_so_and_after_an_error_inside_the_block(backend: Backend):
    drive = Command.position(backend.robot, np.array([0.5, -0.5]))
    with pytest.raises(ZeroDivisionError), backend:
        for command in (drive, Command.limp(backend.robot.n), drive):
            assert turn(backend, command, 5).is_limp == command.is_limp
            assert np.any(backend.read().joint_current) != command.is_limp
        raise ZeroDivisionError
    with backend:
        # A new connection is limp until it gets a command.
        backend.read()
        assert turn(backend, Command.limp(backend.robot.n)).is_limp
        assert np.all(backend.read().joint_current == 0.0)
