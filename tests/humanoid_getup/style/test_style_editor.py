"""What is edited can be undone, is the same in a file, and stays within what a rise can have."""

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from humanoid_getup.style.style import Style
from humanoid_getup.style.style_editor import StyleEditor, rise_time
from humanoid_getup.style.style_file import load_style
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
    point=st.integers(0, 7),
    height=st.floats(0.0, 1.2),
    angle=st.floats(0.0, math.pi),
    duration=st.floats(0.5, 20.0),
)
@settings(max_examples=50, suppress_health_check=[HealthCheck.function_scoped_fixture])
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


def test_every_step_can_be_undone(editor: StyleEditor):
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
        seen.append(editor.style)
    for style in reversed(seen[:-1]):
        editor.undo()
        assert is_same(editor.style, style)
    with pytest.raises(ValueError, match="there is no change to undo"):
        editor.undo()


def test_the_chosen_curves_alone_change(editor: StyleEditor):
    before = editor.style
    editor.chosen = 1
    editor.shift(0.3)
    assert rise_time(editor.curves) == pytest.approx(rise_time(before.curves[1]) + 0.3, abs=0.05)
    assert editor.style.curves[0] is before.curves[0]
    assert editor.style.curves[2] is before.curves[2]


def test_a_rise_that_does_not_end_standing_is_refused_and_nothing_changes(editor: StyleEditor):
    before = editor.style
    for feature, value in ((0, 0.5), (1, 1.0), (2, 2.5)):
        with pytest.raises(ValueError, match="a rise ends"):
            editor.move_point(feature, 8, value)
    with pytest.raises(ValueError, match="there is no point 10"):
        editor.move_point(0, 9, 1.0)
    assert editor.style is before
