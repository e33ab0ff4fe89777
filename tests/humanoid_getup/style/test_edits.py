"""Edits move the time of the rise by what was asked, and keep what they do not edit."""

import numpy as np
import pytest
from nonempty import nonempty

from humanoid_getup.style.curves import StyleCurves
from humanoid_getup.style.style_editor import find_rise, hold, rise_time, shift_rise
from humanoid_getup.style.style_file import list_styles, load_style


def list_curves(robot) -> list[StyleCurves]:
    return [curve for name in list_styles() for curve in load_style(name, robot).curves]


def test_a_straight_rise_is_at_its_middle():
    time = np.linspace(0.0, 2.0, 9)
    assert find_rise(time, 0.2 + 0.4 * time) == pytest.approx(1.0)
    # It sits up to 0.7 at first and lies down again: the last rise counts.
    height = np.array([0.2, 0.7, 0.2, 0.2, 0.2, 0.6, 1.0, 1.0, 1.0])
    assert find_rise(time, height) == pytest.approx(1.25)


@pytest.mark.parametrize("delay", [-0.3, -0.1, 0.1, 0.15])
def test_a_rise_is_moved_by_what_was_asked(op3, delay):
    for curves in nonempty(list_curves(op3)):
        moved = shift_rise(curves, delay)
        assert rise_time(moved) - rise_time(curves) == pytest.approx(delay, abs=0.1 * abs(delay))
        assert moved.duration == curves.duration
        assert moved.points[[0, -1]] == pytest.approx(curves.points[[0, -1]])


def test_a_hold_delays_what_follows(op3):
    for curves in list_curves(op3):
        at = 0.25 * curves.duration
        held = hold(curves, at, 1.0)
        assert held.duration == pytest.approx(curves.duration + 1.0)
        assert rise_time(held) == pytest.approx(rise_time(curves) + 1.0, abs=0.1)
    with pytest.raises(ValueError, match="hold is at 9 s, expected 0 to"):
        hold(curves, 9.0, 1.0)
