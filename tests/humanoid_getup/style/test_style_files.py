"""Style files survive the trip, fit other bodies, and say all that is wrong with them."""

import math

import numpy as np
import pytest
from nonempty import nonempty

from humanoid_getup.style.style_file import (
    list_styles,
    load_any_style,
    load_style,
    read_style,
    write_style,
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


def test_named_styles_begin_in_every_way_of_lying(op3):
    assert list_styles() == ["long-sit", "push-up", "side-sit", "sit-up"]
    for name in list_styles():
        starts = np.degrees([curve.points[0, 1:] for curve in load_style(name, op3).curves])
        assert starts[0] == pytest.approx([90.0, 15.0])  # supine
        assert starts[1, 0] == 25.0  # left
        assert starts[2] == pytest.approx([90.0, 165.0])  # prone


def test_named_styles_ask_for_no_impossible_torso(op3):
    for name in nonempty(list_styles()):
        for curve in nonempty(load_style(name, op3).curves):
            side, front = np.cos(curve.sample(np.linspace(0.0, curve.duration, 100))[:, 1:]).T
            assert np.max(side**2 + front**2) <= 1.0


def test_of_all_styles_a_robot_follows_the_one_that_turns_it_least(op3):
    every = load_any_style(op3)
    assert len(every.curves) == 12
    for features, name in (([0.3, 1.5, 0.3], "long-sit"), ([0.2, 1.6, 2.9], "push-up")):
        chosen = every.choose(np.array(features))
        assert any(np.array_equal(chosen.points, c.points) for c in load_style(name, op3).curves)


def test_a_written_style_reads_back(op3, tmp_path):
    style, file = load_style("sit-up", op3), tmp_path / "mine.toml"
    write_style(style, op3, file)
    again = read_style(file, op3)
    assert (again.name, again.about) == ("mine", style.about)
    for one, other in zip(again.curves, style.curves, strict=True):
        assert one.start == other.start
        assert one.points == pytest.approx(other.points, abs=1e-3)
        assert one.duration == pytest.approx(other.duration, abs=1e-3)


def test_durations_are_scaled_by_the_square_root_of_the_legs(op3, tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text(WHOLE)
    (curve,) = read_style(file, op3).curves
    assert curve.duration == pytest.approx(5.1 * math.sqrt(leg_length(op3) / 0.9))


@pytest.mark.parametrize(
    ("before", "after", "fault"),
    [
        (LINE, "[0.2, 1.0]", "curves 1: neck_height has 2 points, expected 9"),
        (LINE, LINE.replace("1.0", "0.6"), "curves 1: neck_height ends at 0.6 of standing"),
        (
            RIGHT,
            RIGHT.replace("90", "200", 1),
            "curves 1: side is 200° at point 1, expected 0 to 180°",
        ),
        ("5.1", "-5.1", "duration is -5.1 s, expected above 0 s"),
        ("leg_length = 0.9", "", "leg_length is missing"),
        ("duration = 5.1", "", "curves 1: duration is missing, expected seconds"),
        ("5.1", "0.01", "duration is 0.005"),
        (LINE, LINE.replace("0.2", '"0.2"'), "expected a list of finite numbers"),
        (LINE, LINE.replace("0.2", "true"), "expected a list of finite numbers"),
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
