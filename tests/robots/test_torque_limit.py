"""The torque limit: how it acts on a robot's servos, and which values it refuses."""

from dataclasses import replace

import pytest

from robots import FULL_TORQUE, Robot, TorqueLimit
from robots.description.servo_catalog import servo_models


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
