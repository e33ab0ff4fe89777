"""Angles of joints and ticks of encoders, for all joints at once."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.servo_units import ServoUnits, fits_one_turn, tick_range
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


def test_a_quarter_turn_is_1024_ticks_in_the_direction_of_the_sign(units: ServoUnits):
    quarter = np.full(2, np.pi / 2)
    assert units.to_ticks(quarter).tolist() == [2048 + 1024, 1000 - 1024]
    assert units.to_rad(np.array([3072, -24])) == pytest.approx(quarter)
    assert units.to_ticks(np.stack([quarter, -quarter])).tolist() == [[3072, -24], [1024, 2024]]


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


def test_the_ticks_of_a_range_are_in_order_whatever_the_sign(tiny: Robot):
    for sign in (1, -1):
        joint = with_servos(tiny, {"sign": sign, "zero_ticks": 2048}, {}).joints[0]
        joint = replace(joint, lower=-0.5, upper=np.pi / 2)
        expected = (2048 - 326, 3072) if sign > 0 else (1024, 2048 + 326)
        assert tick_range(joint) == expected


@pytest.mark.parametrize(
    ("ticks", "fits"), [((0, 4095), True), ((-1, 100), False), ((100, 4096), False)]
)
def test_goals_of_position_mode_are_one_turn(ticks: tuple[int, int], fits: bool):
    assert fits_one_turn(ticks) == fits
