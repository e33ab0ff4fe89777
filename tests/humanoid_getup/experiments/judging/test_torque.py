"""A servo is saturated on the torque-speed line of its supply; runs are counted across calls."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from humanoid_getup.experiments.judging.torque import count_runs, find_saturation, split_torque
from robots import Robot


@pytest.mark.parametrize("share", [1.0, 0.8])
def test_the_line_falls_with_supply_and_speed(op3: Robot, share: float):
    voltage = share * op3.supply_voltage
    stall, speed = share * op3.max_torque, 0.5 * share * op3.max_velocity
    zero = np.zeros(op3.n)
    assert find_saturation(op3, 0.98 * stall, zero, voltage).all()
    assert not find_saturation(op3, 0.96 * stall, zero, voltage).any()
    half = stall - op3.torque_speed_slope * speed
    assert find_saturation(op3, 0.98 * half, speed, voltage).all()
    assert not find_saturation(op3, 0.96 * half, speed, voltage).any()
    assert not find_saturation(op3, 0.98 * half, -speed, voltage).any(), "it brakes"


def test_a_torque_drives_or_brakes_and_never_both():
    torque, velocity = np.array([2.0, -3.0, 4.0, -5.0, 6.0]), np.array([1.0, -1.0, -1.0, 1.0, 0.0])
    apart = split_torque(torque, velocity)
    assert apart.driving.tolist() == [2.0, 3.0, 0.0, 0.0, 6.0]
    assert apart.braking.tolist() == [0.0, 0.0, 4.0, 5.0, 0.0]


@given(flags=st.lists(st.booleans(), max_size=40), cuts=st.lists(st.integers(0, 40), max_size=4))
def test_a_run_is_counted_however_it_is_cut(flags: list[bool], cuts: list[int]):
    parts = np.split(np.array(flags, dtype=bool)[:, None], sorted(min(c, len(flags)) for c in cuts))
    before, longest = np.zeros(1, dtype=int), 0
    for part in parts:
        runs = count_runs(part, before)
        before = runs[-1] if len(part) else before
        longest = max(longest, runs.max(initial=0))
    text = "".join("x" if flag else " " for flag in flags)
    assert longest == max(map(len, text.split()), default=0)
