"""Styles: which curves a robot follows, and files that fit other bodies or say what is wrong."""

import math
from dataclasses import replace

import numpy as np
import pytest
from nonempty import nonempty

from humanoid_getup.style.curves import StyleCurves
from humanoid_getup.style.style import (
    ALIKE,
    Style,
    list_styles,
    load_any_style,
    load_style,
    read_style,
)
from robots.body.parts import leg_length

LINE = "[0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0]"
RIGHT = "[90, 90, 90, 90, 90, 90, 90, 90, 90]"
WHOLE = f"""
leg_length = 0.9
duration = 5.1

[[curves]]
neck_height = {LINE}
side_deg = {RIGHT}
front_deg = {RIGHT}
"""


def test_named_styles_begin_in_every_way_of_lying_and_ask_for_no_impossible_torso(op3):
    assert list_styles() == ["half-kneel", "long-sit", "push-up", "side-sit", "sit-up"]
    for name in list_styles():
        curves = load_style(name, op3).curves
        starts = np.degrees([curve.values[0, 1:] for curve in curves])
        assert starts[0] == pytest.approx([90.0, 15.0], abs=0.1)  # supine
        assert starts[1, 0] == pytest.approx(25.0, abs=0.1)  # left
        assert starts[2] == pytest.approx([90.0, 165.0], abs=0.1)  # prone
        for curve in nonempty(curves):
            side, front = np.cos(curve.sample(np.linspace(0.0, curve.duration, 100))[:, 1:]).T
            assert np.max(side**2 + front**2) <= 1.0


def test_of_all_styles_a_robot_follows_the_one_that_turns_it_least(op3):
    every = load_any_style(op3)
    assert len(every.curves) == 12
    for features, name in (([0.3, 1.5, 0.3], "long-sit"), ([0.2, 1.6, 2.9], "push-up")):
        chosen = every.choose(np.array(features))
        assert any(np.array_equal(chosen.points, c.points) for c in load_style(name, op3).curves)


def test_durations_are_scaled_by_the_square_root_of_the_legs(op3, tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text(WHOLE)
    (curve,) = read_style(file, op3).curves
    assert curve.duration == pytest.approx(5.1 * math.sqrt(leg_length(op3) / 0.9))


@pytest.mark.parametrize(
    ("before", "after", "fault"),
    [
        (LINE, "[0.2, 1.0]", "curves 1: neck_height has 2 points, expected 9"),
        (LINE, LINE.replace("1.0", "0.6"), "curves 1: neck_height ends at 0.7 of standing"),
        (RIGHT, RIGHT.replace("90", "200", 1), "curves 1: side is 200° at point 1, expected 0 to"),
        ("5.1", "-5.1", "duration is -5.1 s, expected above 0 s"),
        ("leg_length = 0.9", "", "leg_length is missing"),
        ("duration = 5.1", "", "curves 1: duration is missing, expected seconds"),
        (LINE, LINE.replace("0.2", '"0.2"'), "expected a list of finite numbers"),
        ("[[curves]]", "[curves]", "curves is "),
        ("duration", "durations", "unknown key durations"),
        ("0.9\n", "0.9 m\n", "not TOML"),
    ],
)
def test_a_wrong_file_is_refused_in_one_line(op3, tmp_path, before, after, fault):
    file = tmp_path / "wrong.toml"
    file.write_text(WHOLE.replace(before, after, 1))
    with pytest.raises(ValueError) as caught:
        read_style(file, op3)
    assert fault in str(caught.value)
    assert str(caught.value).startswith(f"style file {file}: ")
    assert "\n" not in str(caught.value)


QUARTER = np.pi / 2
SHARE = np.linspace(0.0, 1.0, 9)[:, None]


def rise_from(side: float, front: float, *, detour: float = 0.0) -> StyleCurves:
    """Curves from angles on the ground to a stand, straight but for a detour of the side angle."""
    start, end = np.array([0.2, side, front]), np.array([1.0, QUARTER, QUARTER])
    points = start + SHARE * (end - start)
    points[4, 1] += detour
    return StyleCurves.of(points, 3.0)


SUPINE, LEFT = rise_from(QUARTER, 0.2), rise_from(0.2, QUARTER)


def test_the_curves_that_begin_nearest_are_chosen_or_their_mirror_image():
    style = Style(name="both", curves=(SUPINE, LEFT))
    assert style.choose(np.array([0.3, QUARTER, 0.5])) is SUPINE
    assert style.choose(np.array([0.3, 0.5, QUARTER])) is LEFT
    chosen = style.choose(np.array([0.3, np.pi - 0.5, QUARTER]))
    assert chosen.points[0, 1:] == pytest.approx([np.pi - 0.2, QUARTER])
    assert chosen.duration == LEFT.duration


def test_of_curves_that_begin_nearly_alike_those_that_turn_least_are_chosen():
    winding = rise_from(QUARTER, 0.2 + 0.5 * ALIKE, detour=0.6)
    style = Style(name="alike", curves=(winding, SUPINE))
    assert style.choose(np.array([0.3, QUARTER, 0.3])) is SUPINE
    far = replace(style, curves=(winding, rise_from(QUARTER, 0.2 - 2.0 * ALIKE)))
    assert far.choose(np.array([0.3, QUARTER, 0.3])).points[4, 1] != pytest.approx(QUARTER)
