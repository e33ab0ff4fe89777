"""Currents of servos with and without a sensor."""

from dataclasses import replace

import numpy as np
import pytest
from desk import make_desk

from drivers import SafetyGuard, Twin
from drivers.service.servos.guarded_motion import choose_servos
from drivers.service.servos.waypoints import WaypointController, move_through
from humanoid_getup.cli.robot.servo import motion, squat
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


def test_the_peak_of_a_run_is_the_largest_current_of_the_joints_that_it_tells_of():
    desk = make_desk((1, "XM430-W350"), (3, "XM430-W350"))
    still = WaypointController(desk, np.zeros((1, 2)), speed=1.0, torque_limit=desk.max_torque)
    guard = SafetyGuard(Twin(desk, without_imu=True))
    done = move_through(guard, lambda _: still, realtime=False)
    (arrival,) = done.arrivals
    currents = np.array([[0.1, 0.9], [0.5, 0.2]])
    run = replace(done, arrivals=tuple(replace(arrival, current=row) for row in currents))
    peaks = [motion._describe(desk, k, run, swing=None).peak_current_a for k in (0, 1)]
    assert peaks == [0.5, 0.9]
    assert squat._describe(choose_servos(desk, {}), run, neck_share=0.5).peak_current_a == 0.9
