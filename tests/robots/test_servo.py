"""Ticks and radians, and the servo's figures worked out by hand."""

import math

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robots import Servo
from robots.servo import RAD_PER_TICK, count_pwm, round_pwm, servo_models

XM430 = servo_models()["XM430-W350"]
servos = st.builds(
    Servo,
    id=st.integers(0, 252),
    model=st.just(XM430),
    sign=st.sampled_from([-1, 1]),
    zero_ticks=st.integers(0, 4095),
)


@given(servo=servos, ticks=st.integers(-1_048_575, 1_048_575))
def test_ticks_survive_the_trip_through_radians(servo: Servo, ticks: int):
    assert servo.to_ticks(servo.to_rad(ticks)) == ticks


@given(servo=servos, angle=st.floats(-math.pi, math.pi))
def test_radians_come_back_within_half_a_tick(servo: Servo, angle: float):
    assert abs(servo.to_rad(servo.to_ticks(angle)) - angle) <= RAD_PER_TICK / 2 + 1e-12


@given(servo=servos)
def test_zero_ticks_are_angle_zero_and_the_sign_gives_the_direction(servo: Servo):
    assert servo.to_rad(servo.zero_ticks) == 0.0
    assert math.copysign(1.0, servo.to_rad(servo.zero_ticks + 1)) == servo.sign


@pytest.mark.parametrize(("id", "sign"), [(1, 0), (1, 2), (-1, 1), (253, 1)])
def test_a_wrong_servo_cannot_be_built(id: int, sign: int):
    with pytest.raises(ValueError, match="expected"):
        Servo(id=id, model=XM430, sign=sign, zero_ticks=2048)


def test_position_mode_has_the_manuals_stiffness():
    # P 800 / 128 = 6.25 PWM counts a tick of 885: full duty, 4.1 N·m, at 141.6 ticks or
    # 0.21721 rad: 18.876 N·m/rad.
    assert XM430.position_gain() == pytest.approx(18.876, abs=1e-3)


def test_motor_constants_follow_from_the_datasheet():
    assert XM430.motor_constant == pytest.approx(2.4896, abs=1e-4)  # 12 V / 4.82 rad/s
    # Stall torque = K V / R: R = 2.4896 * 12 / 4.1.
    assert XM430.resistance == pytest.approx(7.2867, abs=1e-4)
    assert XM430.torque_speed_slope == pytest.approx(4.1 / 4.82)


def actuator_torque(robot, voltage: float, velocity: float, error: float) -> float:
    """The torque of the compiled model's first servo at a speed and position error."""
    model = robot.spec().compile()
    model.actuator_gainprm[:] = robot.drive_gains(voltage)
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
    assert actuator_torque(op3, voltage, velocity, error) == pytest.approx(torque, abs=1e-3)


def test_gains_of_many_supplies_come_at_once(op3):
    many = op3.drive_gains(np.array([11.0, 12.0]), np.full((2, op3.n), 0.5))
    assert many.shape == (2, op3.n, 10)
    assert np.array_equal(many[1], op3.drive_gains(12.0, np.full(op3.n, 0.5)))


@given(share=st.floats(-10.0, 10.0))
def test_a_share_of_the_supply_becomes_whole_counts_within_what_there_is(share: float):
    rounded = float(round_pwm(share))
    assert 0.0 <= rounded <= 1.0
    assert float(count_pwm(rounded)) == float(count_pwm(share)), "rounded once, it stays"
    if 0.0 <= share <= 1.0:
        assert share - 1.0 / 885 < rounded <= share + 1e-11
