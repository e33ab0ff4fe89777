"""Figures of a watched robot: the lean of a torso, whatever its heading and its IMU's mounting."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from recording_backend import still_state

from drivers import Command
from drivers.control_loop import Cycle, Timing
from drivers.safety_limits import ClipCounts
from drivers.state import HardwareError
from humanoid_getup.reporting.watched_robot import TorsoFigures, WatchedRobot, describe_torso
from humanoid_getup.simulation.world import World
from robots import Robot, quaternion

X, Y, Z = np.eye(3)
LEANS = st.floats(-1.5, 1.5)
TURNS = st.floats(-3.0, 3.0)


@given(lean=LEANS, heading=TURNS, mounted=TURNS)
@pytest.mark.parametrize(("axis", "name"), [(X, "roll_rad"), (Y, "pitch_rad")])
def test_a_lean_about_one_axis_is_found_alone(tiny, axis, name, lean, heading, mounted):
    leaning = quaternion.from_axis_angle(axis, lean)
    torso = quaternion.multiply(quaternion.from_yaw(heading), leaning)
    mounting = quaternion.from_axis_angle(np.array([0.6, 0.0, 0.8]), mounted)
    gyro = quaternion.rotate(quaternion.inverse(mounting), axis)  # turning on about the axis
    measured = quaternion.multiply(torso, mounting)
    state = still_state(tiny, orientation=measured, gyro=gyro)
    found = TorsoFigures.of(state, mounting)
    expected = {"roll_rad": 0.0, "pitch_rad": 0.0} | {name: lean}
    assert found.roll_rad == pytest.approx(expected["roll_rad"], abs=1e-6)
    assert found.pitch_rad == pytest.approx(expected["pitch_rad"], abs=1e-6)
    assert found.rates_rad_s == pytest.approx(tuple(axis), abs=1e-9)


def test_a_person_reads_the_sign_beside_the_number(tiny: Robot):
    """By hand: leaning to its right by 30 degrees lifts the left side."""
    state = still_state(tiny, orientation=quaternion.from_axis_angle(X, np.pi / 6), gyro=-Z * 1e-4)
    found = TorsoFigures.of(state, np.array([1.0, 0.0, 0.0, 0.0]))
    assert describe_torso(found) == (
        "torso upright: pitch +0.0° (+ forward), roll +30.0° (+ to its right); "
        "gyro x +0, y +0, z +0 °/s"
    )


def test_what_is_silent_latched_or_beyond_its_range_is_remarked(tiny: Robot):
    state = still_state(
        tiny,
        joint_pos=np.radians([75.0, 62.0]),  # of at most 60, and 5.7 more without a remark
        joint_age=np.array([0.0, 1.25]),
        alert=np.array([int(HardwareError.OVERLOAD), 0]),
    )
    limp, clips = Command.limp(tiny.n), ClipCounts(*np.zeros((5, tiny.n), dtype=int))
    timing = Timing(late=0.0, read=0.0, step=0.0, write=0.0)
    watched = WatchedRobot(World(tiny))
    watched.show(Cycle(state=state, asked=limp, sent=limp, clips=clips, timing=timing))
    figures = watched.look()
    left, right = figures.joints.values()
    assert left.remarks == ("overload", "15° beyond its range")
    assert right.remarks == ("silent for 1.2 s",)
    assert left.target_rad is None
