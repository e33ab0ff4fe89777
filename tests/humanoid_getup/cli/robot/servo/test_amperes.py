"""Currents of servos with and without a sensor."""

import pytest
from desk import make_desk

from humanoid_getup.cli.robot.servo.amperes import describe_current, is_estimated


@pytest.mark.parametrize(
    ("model", "expected"),
    [
        ("AX-12A", "~0.25 A (estimated from the load)"),
        ("XL430-W250", "~0.25 A (estimated from the load)"),
        ("STS3215-C018", "~0.25 A (estimated from the load)"),
        ("XM430-W350", "0.25 A"),
        ("XL330-M288", "0.25 A"),
    ],
)
def test_a_current_that_no_sensor_measures_is_marked(model: str, expected: str):
    (joint,) = make_desk((1, model)).joints
    assert describe_current(0.25, estimated=is_estimated(joint)) == expected
