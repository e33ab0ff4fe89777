"""Angles of joints and ticks of encoders, for all joints at once."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.servo_units import ServoUnits, fits_one_turn
from robots import Robot

ANGLES = st.lists(st.floats(-3.0, 3.0), min_size=2, max_size=2)


def with_servos(robot: Robot, *changes: dict) -> Robot:
    joints = (
        replace(joint, servo=replace(joint.servo, **change))
        for joint, change in zip(robot.joints, changes, strict=True)
    )
    return replace(robot, joints=tuple(joints))


@pytest.fixture(scope="module")
def units(tiny: Robot) -> ServoUnits:
    robot = with_servos(tiny, {"sign": 1, "zero_ticks": 2048}, {"sign": -1, "zero_ticks": 1000})
    return ServoUnits(robot)


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


@pytest.mark.parametrize(
    ("ticks", "fits"), [((0, 4095), True), ((-1, 100), False), ((100, 4096), False)]
)
def test_goals_of_position_mode_are_one_turn(ticks: tuple[int, int], fits: bool):
    assert fits_one_turn(ticks) == fits
