"""What the guard does when the robot itself is not well."""

from dataclasses import replace

import numpy as np
import pytest
from recording_backend import RecordingBackend

from drivers import Command, FaultKind, SafetyGuard

PERIOD = RecordingBackend.period
HOLD, LIMP = 3, 12  # periods, the guard's defaults


@pytest.fixture
def backend(tiny) -> RecordingBackend:
    return RecordingBackend(tiny)


@pytest.fixture
def guard(backend):
    with SafetyGuard(backend) as guard:
        yield guard


def turn(guard: SafetyGuard, backend: RecordingBackend, target: float, **changes) -> Command:
    """Run one period in which the robot measures what it is told to."""
    backend.state = replace(backend.state, **changes)
    guard.read()
    return guard.write(Command.position(guard.robot, np.full(2, target)))


def test_a_lost_measurement_or_two_are_bridged(guard, backend):
    for missed in range(HOLD):
        sent = turn(guard, backend, 0.01 * (missed + 1), joint_age=np.array([0.0, missed * PERIOD]))
        assert sent.joint_pos == pytest.approx(0.01 * (missed + 1))
    assert guard.holds == 0


def test_from_the_third_on_every_target_stands_still_until_the_servo_is_back(guard, backend):
    turn(guard, backend, 0.01)
    for missed in range(HOLD, LIMP):
        sent = turn(guard, backend, 0.03, joint_age=np.array([0.0, missed * PERIOD]))
        assert sent.joint_pos == pytest.approx(0.01)
    assert guard.holds == LIMP - HOLD
    assert turn(guard, backend, 0.03, joint_age=np.zeros(2)).joint_pos == pytest.approx(0.03)
    assert guard.fault is None


def test_a_servo_that_stays_silent_makes_the_robot_limp_and_is_named(guard, backend):
    turn(guard, backend, 0.01)
    assert turn(guard, backend, 0.01, joint_age=np.array([0.0, LIMP * PERIOD])).is_limp
    assert guard.fault.kind is FaultKind.LOST_JOINTS
    assert "joint 'r_hip' since 0.10 s" in str(guard.fault)
    assert turn(guard, backend, 0.01, joint_age=np.zeros(2)).is_limp, "it did not latch"


def test_letting_go_is_never_held_up(guard, backend):
    turn(guard, backend, 0.01)
    backend.state = replace(backend.state, joint_age=np.full(2, HOLD * PERIOD))
    guard.read()
    assert guard.write(Command.limp(2)).is_limp


@pytest.mark.parametrize(
    ("changes", "kind", "words"),
    [
        ({"alert": np.array([0, 32])}, FaultKind.SERVO_ERROR, "joint 'r_hip' reports overload"),
        ({"alert": np.array([36, 0])}, FaultKind.SERVO_ERROR, "overheating and overload"),
        ({"alert": np.array([128, 0])}, FaultKind.SERVO_ERROR, "unknown kind"),
        ({"imu_age": 0.4}, FaultKind.LOST_IMU, "since 0.40 s"),
        ({"voltage": 9.9}, FaultKind.LOW_VOLTAGE, "9.9 V, expected 10.0 V or more"),
    ],
)
def test_what_is_not_well_makes_the_robot_limp_at_once(guard, backend, changes, kind, words):
    turn(guard, backend, 0.01)
    assert turn(guard, backend, 0.01, **changes).is_limp
    assert guard.fault.kind is kind
    assert words in str(guard.fault)


def test_a_warm_servo_keeps_less_and_less_of_its_torque(guard, backend):
    limits = []
    for temperature in (60.0, 66.0, 70.0, 75.0):
        sent = turn(guard, backend, 0.0, temperature=np.array([25.0, temperature]))
        limits.append(sent.torque_limit[1])
        assert sent.torque_limit[0] == pytest.approx(4.1)
    # 4.1 N·m to 65 °C, 40 % of it at 75 °C, linear between.
    assert limits == pytest.approx([4.1, 4.1 * 0.94, 4.1 * 0.7, 4.1 * 0.4])
    assert guard.clips.torque[1] == 3


def test_a_stop_outlives_the_connection_and_ends_only_when_cleared(guard, backend):
    turn(guard, backend, 0.01)
    guard.stop("the operator pressed the key")
    assert turn(guard, backend, 0.01).is_limp
    assert guard.fault.kind is FaultKind.STOPPED
    guard.close()
    guard.connect()
    assert turn(guard, backend, 0.01).is_limp
    assert "pressed the key" in str(guard.fault)
    guard.clear()
    assert not turn(guard, backend, 0.01).is_limp
    assert guard.fault is None
