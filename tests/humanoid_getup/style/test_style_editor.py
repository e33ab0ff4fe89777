"""Edits of style curves move the rise as asked, can be undone, and are the same in a file."""

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from nonempty import nonempty

from humanoid_getup.style.curves import StyleCurves
from humanoid_getup.style.style import Style, list_styles, load_style
from humanoid_getup.style.style_editor import StyleEditor, find_rise, hold, rise_time, shift_rise
from robots import Robot


@pytest.fixture
def editor(op3: Robot) -> StyleEditor:
    return StyleEditor(op3, load_style("side-sit", op3))


def is_same(a: Style, b: Style) -> bool:
    same = [
        np.array_equal(one.points, other.points) and one.duration == other.duration
        for one, other in zip(a.curves, b.curves, strict=True)
    ]
    return all(same)


@given(
    point=st.integers(0, 6),
    height=st.floats(0.0, 1.2),
    angle=st.floats(0.0, math.pi),
    duration=st.floats(0.5, 20.0),
)
@settings(max_examples=10, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_a_file_of_it_holds_the_same_curves_to_the_last_bit(
    op3: Robot, tmp_path: Path, point, height, angle, duration
):
    editor, file = StyleEditor(op3, load_style("push-up", op3)), tmp_path / "mine.toml"
    editor.change(editor.move_point(0, point, height))
    editor.change(editor.move_point(1, point, angle))
    editor.last(duration)
    editor.save(file)
    assert editor.style.name == "mine"
    assert is_same(load_style(file, op3), editor.style)


def test_every_step_of_the_chosen_curves_can_be_undone(editor: StyleEditor):
    editor.chosen = 1
    seen = [editor.style]
    for change in (
        lambda: editor.shift(0.2),
        lambda: editor.hold(1.0, 0.3),
        editor.mirror,
        lambda: editor.last(5.0),
        lambda: editor.change(editor.move_point(0, 3, 0.5)),
    ):
        change()
        assert not is_same(editor.style, seen[-1])
        assert all(editor.style.curves[k] is seen[0].curves[k] for k in (0, 2))
        seen.append(editor.style)
    for style in reversed(seen[:-1]):
        editor.undo()
        assert is_same(editor.style, style)
    with pytest.raises(ValueError, match="there is no change to undo"):
        editor.undo()


def test_a_rise_that_does_not_end_standing_is_refused_and_nothing_changes(editor: StyleEditor):
    before = editor.style
    for feature, value in ((0, 0.5), (1, 1.0), (2, 2.5)):
        with pytest.raises(ValueError, match="a rise ends"):
            editor.move_point(feature, 8, value)
    with pytest.raises(ValueError, match="there is no point 10"):
        editor.move_point(0, 9, 1.0)
    assert editor.style is before


def list_curves(robot) -> list[StyleCurves]:
    return [curve for name in list_styles() for curve in load_style(name, robot).curves]


def test_a_straight_rise_is_at_its_middle():
    time = np.linspace(0.0, 2.0, 9)
    assert find_rise(time, 0.2 + 0.4 * time) == pytest.approx(1.0)
    # It sits up to 0.7 at first and lies down again: the last rise counts.
    height = np.array([0.2, 0.7, 0.2, 0.2, 0.2, 0.6, 1.0, 1.0, 1.0])
    assert find_rise(time, height) == pytest.approx(1.25)


def test_a_rise_is_moved_by_what_was_asked_and_a_hold_delays_what_follows(op3):
    for curves in nonempty(list_curves(op3)):
        for delay in (-0.3, 0.1):
            moved = shift_rise(curves, delay)
            later = rise_time(moved) - rise_time(curves)
            assert later == pytest.approx(delay, abs=0.1 * abs(delay))
            assert moved.duration == curves.duration
            assert moved.values[[0, -1]] == pytest.approx(curves.values[[0, -1]], abs=1e-3)
        held = hold(curves, 0.25 * curves.duration, 1.0)
        assert held.duration == pytest.approx(curves.duration + 1.0)
        assert rise_time(held) == pytest.approx(rise_time(curves) + 1.0, abs=0.1)
    with pytest.raises(ValueError, match="hold is at 9 s, expected 0 to"):
        hold(curves, 9.0, 1.0)
