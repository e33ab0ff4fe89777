"""Angles of joints and ticks of encoders, for all joints at once."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.servo_units import ServoUnits, fits_one_turn
from robots import Robot

ANGLES = st.lists(st.floats(-3.0, 3.0), min_size=2, max_size=2)


@pytest.fixture(scope="module")
def units(tiny: Robot) -> ServoUnits:
    places = zip(tiny.joints, (1, -1), (2048, 1000), strict=True)
    joints = (replace(j, servo=replace(j.servo, sign=s, zero_ticks=z)) for j, s, z in places)
    return ServoUnits(replace(tiny, joints=tuple(joints)))


@given(angles=ANGLES)
def test_quantized_angles_are_whole_ticks_and_half_a_tick_away_at_most(units: ServoUnits, angles):
    joint_pos = np.array(angles)
    quantized = units.quantize(joint_pos)
    assert np.abs(quantized - joint_pos).max() <= np.pi / 4096 + 1e-12
    fraction = units.to_fractional_ticks(quantized)
    assert fraction == pytest.approx(np.rint(fraction), abs=1e-6)
    assert np.array_equal(units.to_rad(units.to_ticks(joint_pos)), quantized)


@given(angles=ANGLES)
def test_a_goal_inside_its_range_stays_inside_when_it_is_rounded(units: ServoUnits, tiny, angles):
    goal = np.clip(np.array(angles), tiny.lower, tiny.upper)
    rounded = units.round_goal(goal)
    assert np.all(rounded >= tiny.lower) and np.all(rounded <= tiny.upper)
    assert np.abs(rounded - goal).max() < 2.0 * np.pi / 4096


def test_goals_of_position_mode_are_one_turn():
    found = [fits_one_turn(ticks) for ticks in ((0, 4095), (-1, 100), (100, 4096))]
    assert found == [True, False, False]
