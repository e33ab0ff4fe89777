"""Ticks and radians, figures of servos worked out by hand, and limits of their torque."""

import math
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robots import FULL_TORQUE, Robot, Servo, TorqueLimit
from robots.description.servo_catalog import servo_models
from robots.servo import RAD_PER_TICK, count_pwm, round_pwm
from robots.torque_limit import Drive, limit_servos

XM430 = servo_models()["XM430-W350"]
servos = st.builds(
    Servo,
    id=st.integers(0, 252),
    model=st.just(XM430),
    sign=st.sampled_from([-1, 1]),
    zero_ticks=st.integers(0, 4095),
)


@given(servo=servos, ticks=st.integers(-1_048_575, 1_048_575), angle=st.floats(-math.pi, math.pi))
def test_ticks_survive_the_trip_through_radians(servo: Servo, ticks: int, angle: float):
    assert servo.to_ticks(servo.to_rad(ticks)) == ticks
    assert abs(servo.to_rad(servo.to_ticks(angle)) - angle) <= RAD_PER_TICK / 2 + 1e-12
    assert servo.to_rad(servo.zero_ticks) == 0.0
    assert math.copysign(1.0, servo.to_rad(servo.zero_ticks + 1)) == servo.sign


def test_motor_constants_follow_from_the_datasheet(op3):
    assert XM430.motor_constant == pytest.approx(2.4896, abs=1e-4)  # 12 V / 4.82 rad/s
    # Stall torque = K V / R: R = 2.4896 * 12 / 4.1.
    assert XM430.resistance == pytest.approx(7.2867, abs=1e-4)
    assert XM430.torque_speed_slope == pytest.approx(4.1 / 4.82)
    # The D gain replaces the damping of back-EMF, 4.1 / 4.82 N·m·s/rad, over 18.876 / 6.25 N·m/rad
    # a count, D over 16, each 1 ms.
    assert XM430.d_gain == round(4.1 / 4.82 / (18.876 / 6.25 / 16 * 0.001))
    assert op3.current_damping == pytest.approx(op3.torque_speed_slope, rel=2e-4)


def drive_torque(robot, drive: Drive, voltage: float, velocity: float, error: float) -> float:
    """The torque of the compiled model's first servo at a speed and position error.

    With what VecSim and Simulation write to the model.
    """
    model = robot.spec().compile()
    model.actuator_gainprm[:] = drive.gains(robot, voltage)
    model.actuator_forcerange[:] = np.stack([-drive.torque, drive.torque], axis=1)
    data, layout = mujoco.MjData(model), robot.layout(model)
    data.qvel[layout.dof[0]] = velocity
    data.ctrl[0] = data.qpos[layout.qpos[0]] + error
    mujoco.mj_forward(model, data)
    return float(data.actuator_force[0])


@pytest.mark.parametrize(
    ("voltage", "velocity", "error", "torque"),
    [
        (12.0, 0.0, 1.0, 4.1),  # stall
        (12.0, 2.41, 1.0, 2.05),  # half speed, half torque
        (12.0, 4.82, 1.0, 0.0),  # no load
        (12.0, -4.82, -1.0, 0.0),
        (12.0, 0.0, 0.1, 1.8876),  # stiffness
        (12.0, 2.41, 0.1, 1.8876 - 2.05),  # and back-EMF
        (12.0, -2.41, 1.0, 4.1),  # driven backwards: not more than stall
        (11.0, 0.0, 1.0, 4.1 * 11.0 / 12.0),  # torque and
        (11.0, 4.82 * 11.0 / 12.0, 1.0, 0.0),  # speed follow the supply
        (11.0, 0.0, 0.1, 1.8876 * 11.0 / 12.0),
    ],
)
def test_the_compiled_motor_keeps_the_torque_speed_line(op3, voltage, velocity, error, torque):
    full = limit_servos(op3, op3.max_torque, "pwm")
    assert drive_torque(op3, full, voltage, velocity, error) == pytest.approx(torque, abs=1e-3)


@pytest.mark.parametrize(
    ("by", "velocity", "error", "torque"),
    [
        ("ideal", 0.0, 1.0, 2.0),
        ("ideal", 2.0, 1.0, 2.0),
        ("pwm", 0.0, 1.0, 4.1 * 431 / 885),  # 431.7 counts, rounded down
        ("pwm", 2.0, 1.0, 4.1 * (431 / 885 - 2.0 / 4.82)),  # less the faster it turns
        ("pwm", -2.0, 1.0, 4.1 * (431 / 885 + 2.0 / 4.82)),  # more where it is turned back
        ("current", 0.0, 1.0, 417 * 0.00269 * 4.1 / 2.3),  # 417.09 counts
        ("current", 2.0, 1.0, 417 * 0.00269 * 4.1 / 2.3),  # at any speed that
        ("current", 3.0, 1.0, 4.1 * (1.0 - 3.0 / 4.82)),  # the supply allows
        ("current", -2.0, 1.0, 417 * 0.00269 * 4.1 / 2.3),
        ("current", 0.0, 0.1, 1.8876),  # stiffness
        ("current", 1.0, 0.1, 1.8876 - 4.1 / 4.82),  # damped by its D gain
    ],
)
def test_a_limit_of_2_newton_metres_leaves_what_its_mode_leaves(op3, by, velocity, error, torque):
    drive = limit_servos(op3, 2.0, by)
    assert drive_torque(op3, drive, 12.0, velocity, error) == pytest.approx(torque, abs=1e-3)


def test_a_current_loop_keeps_its_stiffness_at_any_supply(op3):
    for by, stiffness in (("current", 1.8876), ("pwm", 1.8876 * 11.0 / 12.0)):
        drive = limit_servos(op3, 2.5, by)
        assert drive_torque(op3, drive, 11.0, 0.0, 0.1) == pytest.approx(stiffness, abs=1e-3)


@given(share=st.floats(-10.0, 10.0))
def test_a_share_of_the_supply_becomes_whole_counts_within_what_there_is(share: float):
    rounded = float(round_pwm(share))
    assert 0.0 <= rounded <= 1.0
    assert float(count_pwm(rounded)) == float(count_pwm(share)), "rounded once, it stays"
    if 0.0 <= share <= 1.0:
        assert share - 1.0 / 885 < rounded <= share + 1e-11


def test_a_limit_acts_as_the_robot_says_unless_it_says_otherwise(op3: Robot):
    assert TorqueLimit(2.5).on(op3) == TorqueLimit(2.5, "current")
    assert TorqueLimit(2.5).on(replace(op3, limit_by="pwm")) == TorqueLimit(2.5, "pwm")
    for by in ("current", "pwm", "ideal"):
        assert TorqueLimit(2.5, by).on(op3).mode == by
    assert FULL_TORQUE.on(op3).value is None


def test_a_limit_beyond_the_servos_or_that_leaves_no_count_is_refused(op3: Robot):
    assert TorqueLimit(4.1).on(op3).value == 4.1
    with pytest.raises(ValueError, match=r"is 4.2 N·m, expected at most 4.1 N·m, the stall torque"):
        TorqueLimit(4.2).on(op3)
    # One count of Goal Current, and of Goal PWM.
    for by, least in (("current", 0.00480), ("pwm", 4.1 / 885)):
        assert TorqueLimit(1.01 * least, by).on(op3).value == 1.01 * least
        with pytest.raises(ValueError, match=rf"at least 0\.004\d N·m, one count .* by {by}"):
            TorqueLimit(0.99 * least, by).on(op3)


def test_a_mode_that_does_not_exist_or_that_the_servos_lack_is_refused(op3: Robot):
    expected = r"torque limit is by 'PWM', expected one of 'current', 'pwm', 'ideal'"
    with pytest.raises(ValueError, match=expected):
        TorqueLimit(2.5, "PWM")  # type: ignore[arg-type]
    model = servo_models()["XL430-W250"]
    joints = tuple(replace(j, servo=replace(j.servo, model=model)) for j in op3.joints)
    without_sensors = replace(op3, joints=joints, limit_by="pwm")
    assert TorqueLimit(1.0).on(without_sensors).mode == "pwm"
    expected = r"by 'current', expected 'pwm': the XL430-W250 of joint 'r_sho_pitch' has no current"
    with pytest.raises(ValueError, match=expected):
        TorqueLimit(1.0, "current").on(without_sensors)
