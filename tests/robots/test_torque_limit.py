"""The torque limit: what it leaves of a robot's torque, and which values it refuses."""

import math

import pytest

from robots import Robot, TorqueLimit


@pytest.mark.parametrize(("value", "largest"), [(None, 4.1), (9.0, 4.1), (2.5, 2.5)])
def test_no_servo_has_more_than_its_stall_torque(op3: Robot, value: float | None, largest: float):
    assert TorqueLimit(value).largest(op3) == pytest.approx(largest)


@pytest.mark.parametrize("value", [0.0, -1.0, math.nan, math.inf])
def test_a_limit_that_is_no_torque_is_refused(value: float):
    with pytest.raises(ValueError, match=rf"torque limit is {value:g} N·m, expected"):
        TorqueLimit(value)


def test_a_limit_acts_in_one_of_two_ways():
    with pytest.raises(ValueError, match=r"torque limit is by 'PWM', expected 'torque' or 'pwm'"):
        TorqueLimit(2.5, "PWM")  # type: ignore[arg-type]
