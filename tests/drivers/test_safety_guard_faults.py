"""What the guard does when the robot itself is not well."""

from dataclasses import replace

import numpy as np
import pytest
from memory_rig import Rig
from recording_backend import RecordingBackend
from tiny_robots import with_servos

from drivers import Command, FaultKind, GuardLimits, SafetyGuard

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
    backend.state = replace(backend.state, **changes)
    guard.read()
    return guard.write(Command.position(guard.robot, np.full(2, target)))


@pytest.mark.parametrize(
    ("changes", "kind", "words"),
    [
        ({"alert": np.array([0, 32])}, FaultKind.SERVO_ERROR, "joint 'r_hip' reports overload"),
        ({"alert": np.array([36, 0])}, FaultKind.SERVO_ERROR, "overheating and overload"),
        ({"joint_age": np.array([0.0, np.nan])}, FaultKind.LOST_JOINTS, "joint 'r_hip'"),
        ({"imu_age": np.nan}, FaultKind.LOST_IMU, "since nan s"),
        ({"orientation": np.zeros(4)}, FaultKind.BAD_MEASUREMENT, "IMU"),
        ({"orientation": np.zeros(0)}, FaultKind.BAD_MEASUREMENT, "IMU"),  # but a turn rate
        ({"gyro": np.full(3, np.nan)}, FaultKind.BAD_MEASUREMENT, "IMU"),
        *(
            ({name: np.array([0.0, np.nan])}, FaultKind.BAD_MEASUREMENT, "joint 'r_hip'")
            for name in ("joint_pos", "joint_vel", "joint_current", "temperature")
        ),
        ({"imu_age": 0.4}, FaultKind.LOST_IMU, "since 0.40 s"),
        ({"voltage": 9.9, "alert": np.array([1, 32])}, FaultKind.SERVO_ERROR, "reports overload"),
        ({"joint_age": np.array([0.2, 0.3])}, FaultKind.LOST_JOINTS, "all 2 servos since 0.20 s"),
    ],
)
def test_what_is_not_well_makes_the_robot_limp_at_once(guard, backend, changes, kind, words):
    turn(guard, backend, 0.01)
    assert turn(guard, backend, 0.01, **changes).is_limp
    assert guard.fault.kind is kind
    assert words in str(guard.fault)
    assert "r_hip" not in words or "l_hip" not in str(guard.fault), "one is well"


@pytest.mark.parametrize(
    "silence",
    [
        {},
        {"joint_age": np.full(2, HOLD * PERIOD)},  # targets are held
        {"joint_age": np.full(2, LIMP * PERIOD)},
        {"imu_age": 1.0},
        {"time": 0.0},  # the measurement is repeated
        {"voltage": 5.0},
    ],
    ids=str,
)
def test_a_stop_in_any_silence_outlives_it_and_the_connection_until_it_is_cleared(
    guard, backend, silence
):
    sound = backend.state
    for changes in ({}, silence):
        turn(guard, backend, 0.01, **changes)
    guard.stop("the operator pressed the key")
    assert turn(guard, backend, 0.01).is_limp
    assert guard.fault.kind is FaultKind.STOPPED
    backend.state = replace(sound, time=1.0)
    assert turn(guard, backend, 0.01).is_limp
    guard.close()
    guard.connect()
    assert turn(guard, backend, 0.01).is_limp
    assert "pressed the key" in str(guard.fault)
    for reason in (None, "a press that is cleared before a command"):
        if reason is not None:
            guard.stop(reason)
        guard.clear()
        assert not turn(guard, backend, 0.01).is_limp
        assert guard.fault is None


@pytest.mark.parametrize(
    ("name", "within", "beyond", "kind"),
    [
        ("temperature", np.array([75.0, 25.0]), np.array([75.1, 25.0]), FaultKind.TOO_HOT),
        ("imu_age", 0.3, 0.301, FaultKind.LOST_IMU),
        ("joint_age", np.array([0.0, 11.4]) * PERIOD, np.array([0.0, 11.6]) * PERIOD,
         FaultKind.LOST_JOINTS),
    ],
)  # fmt: skip
def test_what_is_just_beyond_its_limit_is_a_fault_of_that_moment(
    guard, backend, name, within, beyond, kind
):
    turn(guard, backend, 0.0)
    assert not turn(guard, backend, 0.0, **{name: within}).is_limp
    assert guard.fault is None
    assert turn(guard, backend, 0.0, **{name: beyond}, time=0.05).is_limp
    assert (guard.fault.kind, guard.fault.time) == (kind, 0.05)


@pytest.mark.parametrize(("age", "holds"), [(2.4, 0), (2.6, 1)])
def test_targets_are_held_from_two_and_a_half_periods_without_a_measurement(
    guard, backend, age, holds
):
    turn(guard, backend, 0.01)
    sent = turn(guard, backend, 0.02, joint_age=np.array([age * PERIOD, 0.0]))
    assert guard.holds == holds
    assert sent.joint_pos == pytest.approx(0.01 if holds else 0.02)
    backend.state = replace(backend.state, joint_age=np.full(2, HOLD * PERIOD))
    guard.read()
    assert guard.write(Command.limp(2)).is_limp, "letting go is never held up"
    guard.connect()
    assert guard.holds == 0, "each connection counts its own"


def pass_time(guard: SafetyGuard, backend: RecordingBackend, seconds: float, **changes) -> Command:
    for _ in range(round(seconds / PERIOD)):
        sent = turn(guard, backend, 0.0, **changes)
    return sent


def test_a_dip_of_the_supply_takes_torque_first_and_ends_the_motion_if_it_stays(guard, backend):
    full = 4.1
    assert pass_time(guard, backend, 0.1, voltage=10.0 - 2e-15).torque_limit[0] == full
    # 40 % of the torque at 9.5 V, linear from 10 V on.
    for voltage, share in ((9.9, 0.88), (9.6, 0.52), (9.5, 0.4)):
        dip = pass_time(guard, backend, 1.0, voltage=voltage)
        assert dip.torque_limit == pytest.approx(np.full(2, share * full), abs=1e-4)
        assert pass_time(guard, backend, 0.12, voltage=10.1).torque_limit[0] == full
    assert guard.fault is None
    assert not pass_time(guard, backend, 1.99, voltage=9.9).is_limp
    assert pass_time(guard, backend, 0.05, voltage=9.9).is_limp
    assert "9.9 V for 2.0 s, expected 10.0 V or more" in str(guard.fault)


@pytest.mark.parametrize(
    ("changes", "kind", "words"),
    [
        ({"voltage": 9.4}, FaultKind.LOW_VOLTAGE, "9.4 V for 0.1 s, expected 10.0 V or more"),
        ({"voltage": 9.9, "alert": np.array([1, 128])}, FaultKind.LOW_VOLTAGE, "9.9 V"),
        ({"alert": np.array([1, 1])}, FaultKind.SERVO_ERROR, "reports voltage"),
        ({"alert": np.array([128, 0])}, FaultKind.SERVO_ERROR, "unknown kind"),
    ],
)
def test_a_supply_below_the_least_of_servos_takes_torque_and_ends_the_motion_if_it_stays(
    guard, backend, changes, kind, words
):
    well = {"voltage": 12.0, "alert": np.zeros(2, dtype=int)}
    for _ in range(3):
        dip = pass_time(guard, backend, 0.1, **changes)
        assert dip.torque_limit == pytest.approx(np.full(2, 0.4 * 4.1), abs=1e-4)
        back = [
            float(turn(guard, backend, 0.0, **well).torque_limit[0])
            for _ in range(round(0.12 / PERIOD))
        ]
        assert np.diff(back).max() < 0.5, "torque comes back in steps"
        assert back[-1] == 4.1
    assert guard.fault is None
    assert pass_time(guard, backend, 0.12, **changes).is_limp
    assert guard.fault.kind is kind
    assert words in str(guard.fault)


def test_a_guard_that_judges_no_supply_takes_no_torque(backend):
    limits = replace(GuardLimits.of(backend.robot), min_voltage=0.0)
    with SafetyGuard(backend, limits) as guard:
        for voltage in (11.1, 9.0, 12.0):
            assert pass_time(guard, backend, 4.0, voltage=voltage).torque_limit[0] == 4.1


def test_after_a_pause_under_torque_the_robot_is_held_where_it_is_measured(guard, backend):
    turn(guard, backend, 0.02)
    backend.state = replace(backend.state, joint_pos=np.array([0.3, -0.2]))
    for target in (2.7, 2.8):  # where a motion has gone on to
        sent = turn(guard, backend, target, time=backend.state.time + 2.0)
        assert sent.joint_pos.tolist() == [0.3, -0.2]
        assert guard.fault.kind is FaultKind.PAUSED
    assert "2.01 s between two cycles, expected at most 0.10 s" in str(guard.fault)
    guard.resume()
    sent = turn(guard, backend, 2.8)
    assert guard.fault is None
    step = guard.limits.max_velocity * PERIOD
    assert sent.joint_pos == pytest.approx(backend.state.joint_pos + step)


@pytest.mark.parametrize(
    "ends", [{"alert": np.array([0, 32])}, {"temperature": np.full(2, 80.0)}, None]
)
def test_what_follows_a_pause_still_ends_limp(guard, backend, ends):
    guard.read()
    guard.write(Command.limp(2))
    assert not turn(guard, backend, 0.02, time=backend.state.time + 2.0).is_limp
    assert guard.fault is None, "without torque it is no pause"
    turn(guard, backend, 0.02)
    assert not turn(guard, backend, 0.02, time=backend.state.time + 2.0).is_limp
    if ends is None:
        guard.stop("a key")
        guard.resume()
    assert turn(guard, backend, 0.02, **(ends or {})).is_limp
    assert guard.fault.kind is not FaultKind.PAUSED


def test_a_joint_that_is_released_alone_gets_its_angle_and_the_other_its_target(guard, backend):
    backend.state = replace(backend.state, joint_pos=np.array([0.2, 0.0]))
    guard.read()
    command = Command.position(guard.robot, np.array([0.9, 0.01]))
    sent = guard.write(replace(command, torque_limit=np.array([0.0, 1.0])))
    assert sent.joint_pos == pytest.approx([0.2, 0.01])
    assert guard.clips.total == 0


def test_connecting_releases_only_what_is_open_and_a_first_command_measures(tiny, backend):
    """A backend that is closed cannot be written to."""
    guard = SafetyGuard(backend)
    for _ in range(2):
        guard.connect()
        assert backend.received == []
        guard.close()
    guard.connect()
    guard.connect()
    assert [command.is_limp for command in backend.received] == [True]
    assert backend.received[0].joint_pos.shape == (tiny.n,)
    backend.state = replace(backend.state, joint_pos=np.array([0.4, -0.2]))
    sent = guard.write(Command.position(tiny, np.array([0.41, -0.2])))
    assert sent.joint_pos == pytest.approx([0.41, -0.2])
    guard.close()


# Limits ------------------------------------------------------------------------------------------


def test_a_torque_limit_holds_where_a_servo_has_more_and_one_that_limits_nothing_is_refused(tiny):
    assert np.array_equal(GuardLimits.of(tiny, 1.5).torque_limit, [1.5, 1.5])
    assert np.array_equal(GuardLimits.of(tiny, 99.0).torque_limit, tiny.max_torque)
    for wrong in (-0.1, np.inf, np.nan):
        with pytest.raises(ValueError, match=r"torque limit is .* N·m, expected a finite number"):
            GuardLimits.of(tiny, wrong)
    for name, values, words in (
        ("lower", [0.0, 2.0], "lower must not exceed upper"),
        ("max_velocity", [1.0, -0.1], "max_velocity is"),
        ("max_velocity", [1.0, np.inf], "max_velocity is"),
        ("torque_limit", [np.nan, 1.0], "torque_limit is"),
        ("torque_limit", [-0.1, 1.0], "torque_limit is"),
    ):
        with pytest.raises(ValueError, match=words):
            replace(GuardLimits.of(tiny), **{name: np.array(values)})


def test_torque_falls_from_the_whole_to_two_fifths_over_ten_degrees(tiny):
    limits = GuardLimits.of(tiny, 2.0)
    for degrees, torque in ((20.0, 2.0), (65.0, 2.0), (70.0, 1.4), (75.0, 0.8), (99.0, 0.8)):
        assert limits.derate(np.full(2, degrees)) == pytest.approx([torque] * 2)
    model = replace(tiny.joints[1].servo.model, temperature_limit=70.0)  # its type's own
    limits = GuardLimits.of(with_servos(tiny, {}, {"model": model}))
    assert limits.max_temperature.tolist() == [75.0, 65.0]
    assert limits.derate(np.array([60.0, 60.0])) == pytest.approx([4.1, 4.1 * 0.7])


@pytest.mark.parametrize("limit", [40, 79, 80, 95])
def test_a_guard_goes_by_the_limits_inside_the_servos_where_they_are_the_narrower(tiny, limit):
    rig = Rig(tiny)
    rig.servo("r_hip").poke("temperature_limit", limit)
    rig.servo("r_hip").poke("min_voltage_limit", 112)
    own = GuardLimits.of(tiny)
    with SafetyGuard(rig.backend) as guard:
        lowest = min(limit, 80)
        assert guard.limits.max_temperature == pytest.approx([75.0, lowest - 5.0])
        assert guard.limits.derate_temperature == pytest.approx([65.0, lowest - 15.0])
        assert (own.min_voltage, guard.limits.min_voltage) == (10.0, 11.2)
    rig.poke("temperature_limit", 80)
    rig.poke("min_voltage_limit", 95)
    with guard:
        assert guard.limits.max_temperature == pytest.approx(own.max_temperature)
        assert guard.limits.min_voltage == own.min_voltage, "a limit that was set back stays"


def test_a_servo_is_released_before_it_switches_itself_off(tiny):
    rig, limits = Rig(tiny), []
    rig.servo("r_hip").poke("temperature_limit", 50)
    with SafetyGuard(rig.backend) as guard:
        for degrees in (34.0, 40.0, 46.0):
            rig.virtual.physics.heat(2, degrees)
            for _ in range(20):  # one slow value of one servo a cycle
                sent = guard.write(rig.hold(guard.read()))
            limits.append(sent.torque_limit[1] / tiny.max_torque[1])
        assert limits == pytest.approx([1.0, 0.7, 0.0], abs=0.01)
        assert str(guard.fault).endswith("joint 'r_hip' has 46 °C, expected at most 45 °C")
        assert not any(rig.peek("hardware_error_status"))
