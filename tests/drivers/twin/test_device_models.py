"""Heat of servos of other sizes than the XM430."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.twin.device_models import AMBIENT_TEMPERATURE, Windings
from robots import Robot
from robots.description.servo_catalog import servo_models


def fit(robot: Robot, *names: str) -> Robot:
    """Put servos of certain types on a robot's joints."""
    pairs = zip(robot.joints, names, strict=True)
    joints = (
        replace(joint, servo=replace(joint.servo, model=servo_models()[name]))
        for joint, name in pairs
    )
    return replace(robot, joints=tuple(joints))


def test_heat_follows_from_the_mass_of_a_type(tiny: Robot):
    windings = Windings(fit(tiny, "XM430-W350", "XM540-W270"))
    # By hand: 82 g and 165 g of 0.5 J/(g·K); the surface of the XM540 is 2.012^(2/3) = 1.594
    # times that of the XM430, which has 13 K/W. From its own dimensions it is 1.55 times.
    assert windings.heat_capacity == pytest.approx([41.0, 82.5])
    assert windings.heat_resistance == pytest.approx([13.0, 13.0 / 1.594], rel=1e-3)


@settings(max_examples=10)
@given(current=st.floats(0.1, 2.0))
def test_a_servo_settles_where_the_air_takes_all_its_loss_away(tiny: Robot, current: float):
    robot = fit(tiny, "XC330-T288", "XM430-W350")
    windings = Windings(robot)
    for _ in range(2000):
        windings.heat(np.full(2, current), 5.0)
    models = [joint.servo.model for joint in robot.joints]
    loss = np.array([current**2 * m.nominal_voltage / m.stall_current for m in models])
    excess = windings.temperature - AMBIENT_TEMPERATURE
    assert excess == pytest.approx(loss * windings.heat_resistance)
