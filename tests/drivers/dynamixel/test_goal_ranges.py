"""Goals of servos of different kinds: ranges, counts of the supply, gains of a compliance slope."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.dynamixel.control_table import table_named
from drivers.dynamixel.goal_ranges import full_scale, goal_range, round_gain, to_slope

SLOPES = (2, 4, 8, 16, 32, 64, 128)  # those that an AX distinguishes (e-manual)


@given(gain=st.integers(0, 64))
def test_a_gain_becomes_the_next_softer_slope(gain: int):
    rounded, slope = int(round_gain(np.array(gain))), int(to_slope(np.array(gain)))
    assert slope in SLOPES
    assert slope * rounded == 128
    assert rounded <= max(gain, 1) < 2 * rounded


def test_the_gain_as_shipped_is_the_slope_as_shipped():
    assert to_slope(np.array([4, 2, 1, 0])).tolist() == [32, 64, 128, 128]
    assert table_named("AX-12A")["cw_compliance_slope"].default == 32


@pytest.mark.parametrize(
    ("model", "ends", "full"),
    [
        ("XM430-W350", (-1_048_575, 1_048_575), 885),  # in extended position mode
        ("AX-12A", (0, 1023), 1023),
        ("XL-320", (0, 1023), 1023),
        ("STS3215", (0, 4095), 1000),
    ],
)
def test_positions_and_supply_have_the_counts_of_the_manual(model: str, ends, full: int):
    table = table_named(model)
    assert goal_range(table) == ends
    assert full_scale(table) == full
