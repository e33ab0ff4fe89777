"""A virtual servo's motion: what its motor is asked to do, and where it says it is."""

import itertools
import math

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from nonempty import nonempty
from wire_talk import powered, read, sense, write

from drivers.dynamixel.protocol2 import ErrorNumber, Instruction
from drivers.virtual_bus.devices.profile import ProfileShape, ProfileTrajectory, plan_by_velocity
from drivers.virtual_bus.devices.sensors import Measured
from drivers.virtual_bus.devices.servo import CLEAR_TURNS, VirtualServo

TURN = 4096
SPEED = 0.229 * 2 * math.pi / 60  # rad/s a count
IN_POSITION, RUNNING, ASTRAY = 1, 2, 8  # bits of Moving Status


RAW, MODE = st.integers(-20 * TURN, 20 * TURN), st.sampled_from([3, 4, 5])


@given(raw=RAW, homing=st.integers(-3000, 3000), reverse=st.integers(0, 1), mode=MODE)
def test_the_motor_is_sent_to_where_the_register_says(raw, homing, reverse, mode):
    """Whatever offset, direction and turn: aiming at the present position is no motion."""
    servo = VirtualServo(1)
    write(servo, "operating_mode", mode)
    write(servo, "homing_offset", homing)
    write(servo, "drive_mode", reverse)
    sense(servo, ticks=raw)
    write(servo, "torque_enable", 1)
    assert servo.motor_command().target_ticks == raw
    counted = 0 if mode == 3 and abs(homing) > 1024 else homing
    sign = -1 if reverse else 1
    shown = read(servo, "present_position")
    if mode == 3:
        assert shown == (sign * raw) % TURN + counted
    else:  # turns are counted from where the drive mode was set
        assert (shown - sign * raw - counted) % TURN == 0
    if mode != 3 and write(servo, "goal_position", shown + 100) == 0:
        assert servo.motor_command().target_ticks == raw + sign * 100
    servo.reboot()
    servo.advance(1.0)
    assert 0 <= read(servo, "present_position") - counted < TURN, "a start is inside one turn"


def test_sensors_show_si_values_in_counts_of_their_model():
    servo = VirtualServo(1)
    servo.sense(Measured(99.6, 1.0, -1.0, -1.0, 11.14, 41.6))
    names = ("position", "velocity", "current", "pwm", "input_voltage", "temperature")
    shown = [read(servo, f"present_{name}") for name in names]
    assert shown == [100, round(1.0 / SPEED), -372, -885, 111, 42]  # 1 A / 2.69 mA
    xl430 = VirtualServo(1, "XL430-W250")
    sense(xl430, pwm_share=0.25)
    assert read(xl430, "present_load") == 250  # 0.1 %


def test_clear_drops_turns_at_standstill_and_nothing_moves():
    servo = powered(operating_mode=4)
    write(servo, "goal_position", 3 * TURN + 5)
    sense(servo, ticks=3 * TURN + 5)
    before = servo.motor_command().target_ticks
    status = servo.handle(Instruction.CLEAR, CLEAR_TURNS)
    assert status is not None and status.error == 0
    assert read(servo, "present_position") == read(servo, "goal_position") == 5
    assert servo.motor_command().target_ticks == before
    moving, old = VirtualServo(1), VirtualServo(1, firmware=41)
    sense(moving, velocity=1.0)
    for each, params, error in (
        (servo, CLEAR_TURNS[:-1], ErrorNumber.DATA_RANGE),
        (moving, CLEAR_TURNS, ErrorNumber.RESULT_FAIL),
        (old, CLEAR_TURNS, ErrorNumber.INSTRUCTION),
    ):
        status = each.handle(Instruction.CLEAR, params)
        assert status is not None and status.number == error


def test_torque_on_holds_the_present_position_whatever_the_old_goal():
    servo = VirtualServo(1)
    write(servo, "goal_position", 4000)
    sense(servo, ticks=1000.0)
    assert not servo.motor_command().torque_on
    write(servo, "torque_enable", 1)
    assert servo.motor_command().torque_on and servo.motor_command().target_ticks == 1000.0
    assert read(servo, "goal_position") == 1000
    servo = VirtualServo(1)
    write(servo, "drive_mode", 8)  # torque by goal update
    assert not servo.motor_command().torque_on
    write(servo, "goal_position", 2100)
    assert servo.motor_command().torque_on and servo.motor_command().target_ticks == 2100.0
    assert read(servo, "torque_enable") == 1


def test_a_goal_by_action_or_indirect_data_moves_the_motor_too():
    servo = powered()
    servo.handle(Instruction.REG_WRITE, b"\x74\0\x10\x0a\0\0")
    assert servo.motor_command().target_ticks == 2048.0
    servo.handle(Instruction.ACTION)
    assert servo.motor_command().target_ticks == 0x0A10
    for i in range(4):
        write(servo, f"indirect_address_{i + 1}", 116 + i)
    servo.handle(Instruction.WRITE, b"\xe0\0\x00\x09\0\0")
    assert servo.motor_command().target_ticks == 0x0900


def test_a_profile_takes_the_target_along_and_the_flags_tell():
    servo = powered(profile_velocity=100, profile_acceleration=20)
    write(servo, "goal_position", 3048)
    # Ramps of 64 * 100 / 20 = 320 ms; 1563.3 ticks/s; 1000 ticks in 640 ms + 320 ms.
    assert read(servo, "moving") == 1
    assert read(servo, "moving_status") & 0x3F == 3 << 4 | RUNNING
    servo.advance(0.32)
    assert servo.motor_command().target_ticks == pytest.approx(2048 + 250.1, abs=0.5)
    assert read(servo, "position_trajectory") == 2298
    assert read(servo, "velocity_trajectory") == 100
    sense(servo, ticks=2150.0, velocity=1.0)
    assert read(servo, "moving_status") & ASTRAY
    sense(servo, ticks=2250.0, velocity=1.0)
    assert not read(servo, "moving_status") & ASTRAY
    servo.advance(0.95)
    assert read(servo, "moving_status") & RUNNING
    servo.advance(0.97)
    assert not read(servo, "moving_status") & RUNNING
    assert servo.motor_command().target_ticks == 3048.0
    sense(servo, ticks=3045.0)
    assert read(servo, "moving") == 0
    assert read(servo, "moving_status") & 0xF == IN_POSITION


GOAL = st.tuples(st.integers(-1_048_575, 1_048_575), *[st.integers(0, 32737)] * 2)


@given(goals=st.lists(GOAL, min_size=1, max_size=6), drive_mode=st.sampled_from([0, 1]))
def test_no_profile_is_too_wild_for_the_registers(goals, drive_mode):
    servo = powered(operating_mode=4, drive_mode=drive_mode)
    for i, (goal, velocity, acceleration) in nonempty(enumerate(goals)):
        write(servo, "profile_velocity", velocity)
        write(servo, "profile_acceleration", acceleration)
        assert write(servo, "goal_position", goal) == 0
        servo.advance(0.37 * (i + 1))
        assert math.isfinite(servo.motor_command().target_ticks)


# Profiles ----------------------------------------------------------------------------------------

ticks = st.floats(-4096.0, 4096.0)
speeds = st.floats(-2000.0, 2000.0)
START = 5.0


def sample(path: ProfileTrajectory, count: int = 200) -> list[tuple[float, float, float]]:
    times = [START + (path.end - START) * i / count for i in range(count + 1)]
    return [(t, *path.at(t)) for t in times]


@given(position=ticks, velocity=speeds, goal=ticks, top=st.floats(10, 3000), a=st.floats(50, 2e4))
def test_a_path_ends_at_rest_at_its_goal_and_is_never_faster_or_rougher_than_allowed(
    position, velocity, goal, top, a
):
    path = plan_by_velocity(START, position, velocity, goal, top, a)
    assert path.at(path.end) == path.at(path.end + 100.0) == (goal, 0.0)
    where, speed = path.at(path.end - 1e-6)
    assert where == pytest.approx(goal, abs=0.05)
    assert abs(speed) <= a * 1e-5 + 1e-6
    assume(path.end > START)
    points = sample(path)
    step = points[1][0] - points[0][0]
    fastest = max(top, abs(velocity))
    for (_, x0, v0), (_, x1, v1) in nonempty(itertools.pairwise(points)):
        assert abs(v1) <= fastest * (1 + 1e-9)
        assert abs(v1 - v0) <= a * step * (1 + 1e-6) + 1e-6
        # Velocity is the slope of position: within a step it is between its ends, or bends once.
        assert abs((x1 - x0) - 0.5 * (v0 + v1) * step) <= a * step * step + 1e-6


@given(goal=st.floats(1.0, 4096.0), top=st.integers(1, 500), a=st.integers(1, 500))
def test_the_ramp_lasts_64_ms_times_velocity_over_acceleration(goal: float, top: int, a: int):
    """The e-manual's t1 = 64 V / A [ms], V and A in counts of 0.229 rpm and 214.577 rev/min²."""
    v, acceleration = top * 0.229 * 4096 / 60, a * 214.577 * 4096 / 3600
    path = plan_by_velocity(0.0, 0.0, 0.0, goal, v, acceleration)
    if path.shape is ProfileShape.TRAPEZOID:
        assert path.speed_up == pytest.approx(0.064 * top / a, rel=1e-3)
        assert path.end == pytest.approx(goal / v + path.speed_up)  # a trapezoid's area
    else:
        assert path.shape is ProfileShape.TRIANGLE
        assert path.end == pytest.approx(2.0 * (goal / acceleration) ** 0.5)
    path = plan_by_velocity(1.0, 0.0, 0.0, 9.0, 0.0, 5.0)  # without velocity
    assert (path.shape, path.at(1.0)) == (ProfileShape.STEP, (9.0, 0.0))
    path = plan_by_velocity(0.0, 100.0, 0.0, -100.0, 50.0, 0.0)  # without acceleration
    assert (path.shape, path.end, path.at(1.0)) == (ProfileShape.RECTANGLE, 4.0, (50.0, -50.0))
