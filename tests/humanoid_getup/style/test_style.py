"""A style: of several curves, or their mirror images, a robot follows the nearest."""

from dataclasses import replace

import numpy as np
import pytest

from humanoid_getup.style.curves import StyleCurves
from humanoid_getup.style.style import ALIKE, Style

RIGHT = np.pi / 2
SHARE = np.linspace(0.0, 1.0, 9)[:, None]


def rise_from(side: float, front: float, *, detour: float = 0.0) -> StyleCurves:
    """Curves from angles on the ground to a stand, straight but for a detour of the side angle."""
    start, end = np.array([0.2, side, front]), np.array([1.0, RIGHT, RIGHT])
    points = start + SHARE * (end - start)
    points[4, 1] += detour
    return StyleCurves.of(points, 3.0)


SUPINE, LEFT = rise_from(RIGHT, 0.2), rise_from(0.2, RIGHT)


def begins(curves: StyleCurves) -> np.ndarray:
    return curves.points[0, 1:]


def test_the_curves_that_begin_nearest_are_chosen():
    style = Style(name="both", curves=(SUPINE, LEFT))
    assert style.choose(np.array([0.3, RIGHT, 0.5])) is SUPINE
    assert style.choose(np.array([0.3, 0.5, RIGHT])) is LEFT


def test_a_robot_on_the_other_side_follows_the_mirror_image():
    style = Style(name="left", curves=(LEFT,))
    chosen = style.choose(np.array([0.3, np.pi - 0.5, RIGHT]))
    assert begins(chosen) == pytest.approx([np.pi - 0.2, RIGHT])
    assert chosen.duration == LEFT.duration


def test_of_curves_that_begin_nearly_alike_those_that_turn_least_are_chosen():
    winding = rise_from(RIGHT, 0.2 + 0.5 * ALIKE, detour=0.6)
    style = Style(name="alike", curves=(winding, SUPINE))
    assert style.choose(np.array([0.3, RIGHT, 0.3])) is SUPINE
    far = replace(style, curves=(winding, rise_from(RIGHT, 0.2 - 2.0 * ALIKE)))
    assert far.choose(np.array([0.3, RIGHT, 0.3])).points[4, 1] != pytest.approx(RIGHT)
