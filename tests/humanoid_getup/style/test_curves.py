"""Style curves stay in the hull of their points, rest at both ends, begin at a measurement."""

import math

import numpy as np
import pytest
import scipy.interpolate
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from humanoid_getup.style.curves import (
    BLEND_SHARE,
    PLACES,
    UPRIGHT_STAND,
    CurveTargets,
    StyleCurves,
)
from humanoid_getup.style.features import mirror_features

UPRIGHT = [1.0, math.pi / 2, math.pi / 2]


def make_points(inner: np.ndarray) -> np.ndarray:
    """Make control points whose last two are a stand, from shares of the ranges, (7, 3)."""
    return np.concatenate([inner * [1.2, math.pi, math.pi], [UPRIGHT] * 2])


points_of_rises = arrays(float, (7, 3), elements=st.floats(0.0, 1.0)).map(make_points)
durations = st.floats(0.1, 60.0)


@given(points=points_of_rises, duration=durations)
def test_curves_are_cardinal_cubic_splines_within_their_control_points(points, duration):
    """SciPy's, with knots equally apart and control points that are mirrored at both ends."""
    curves, share = StyleCurves.of(points, duration), np.linspace(0.0, 1.0, 50)
    mirrored = np.concatenate([points[1:2], points, points[-2:-1]])
    spline = scipy.interpolate.BSpline(np.arange(-3, 12) / 8, mirrored, 3)
    sampled = curves.sample(share * duration)
    assert sampled == pytest.approx(spline(share), abs=1e-9)
    # Each piece is within the hull of the four control points around it.
    piece = np.minimum((share * 8).astype(int), 7)
    around = mirrored[piece[:, None] + np.arange(4)]
    assert (sampled >= around.min(axis=1) - 1e-9).all()
    assert (sampled <= around.max(axis=1) + 1e-9).all()


@given(points=points_of_rises, duration=durations)
def test_curves_rest_at_both_ends_and_are_found_again_from_their_values(points, duration):
    curves, step = StyleCurves.of(points, duration), 1e-5 * duration
    assert curves.values == pytest.approx(curves.sample(PLACES * duration))
    assert StyleCurves.through(curves.values, duration).points == pytest.approx(points, abs=1e-9)
    begin = curves.sample(np.array([0.0, step]))
    end = curves.sample(np.array([duration - step, duration, 3.0 * duration]))
    assert np.abs(np.diff(begin, axis=0)).max() < 1e-6
    assert np.abs(np.diff(end, axis=0)).max() < 1e-6


@given(points=points_of_rises, time=st.floats(0.0, 5.0))
def test_mirrored_curves_mirror_every_moment(points, time):
    curves = StyleCurves.of(points, 4.0)
    mirrored = curves.mirrored()
    assert mirrored.sample(time) == pytest.approx(mirror_features(curves.sample(time)))
    assert mirrored.mirrored().points == pytest.approx(points)


def test_curves_through_values_keep_both_ends_where_a_control_point_cannot_follow():
    """To rise at once at the end, control points would be beyond a half turn and 1.2."""
    values = np.tile([0.2, np.pi / 2, np.pi], (9, 1))
    values[8] = UPRIGHT_STAND
    curves = StyleCurves.through(values, 4.0, "prone")
    assert curves.values[[0, -1]] == pytest.approx(values[[0, -1]])
    assert curves.points.max(axis=0) == pytest.approx([1.2, np.pi / 2, np.pi])
    retimed = curves.retimed(PLACES * 4.0, 5.0)
    assert retimed.points == pytest.approx(curves.points)
    assert (retimed.duration, retimed.start) == (5.0, "prone")


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        ({"side": np.zeros(5)}, r"side has shape \(5,\), expected \(9,\)"),
        ({"front": np.full(9, 4.0)}, "front is 229.183° at point 1, expected 0 to 180°"),
        ({"side": np.full(9, np.nan)}, "side is nan° at point 1"),
        ({"neck_height": np.linspace(0.2, 0.8, 9)}, "neck_height ends at 0.775 of standing"),
        ({"front": np.full(9, math.radians(120.0))}, "front ends at 120°, expected 75 to 105°"),
        ({"duration": -2.0}, "duration is -2 s, expected 0.1 to 60 s"),
        ({"duration": math.nan}, "duration is nan s"),
    ],
)
def test_impossible_curves_cannot_be_made(change, fault):
    right = np.full(9, math.pi / 2)
    whole = {"neck_height": np.linspace(0.2, 1.0, 9), "side": right, "front": right, "duration": 2}
    StyleCurves(**whole)
    with pytest.raises(ValueError, match=fault):
        StyleCurves(**(whole | change))


def make_curves(begin: float, duration: float) -> StyleCurves:
    height = np.linspace(begin, 1.0, 9)
    right = np.full(9, math.pi / 2)
    return StyleCurves(neck_height=height, side=right, front=right, duration=duration)


def test_each_robot_enters_its_curves_from_what_it_measures_and_then_follows_them():
    curves = [make_curves(0.2, 4.0), make_curves(0.3, 2.0)]
    measured = np.array([[0.25, 1.2, 0.4], [0.31, 1.6, 2.0]])
    targets = CurveTargets(2)
    targets.enter(
        np.arange(2),
        np.array([curve.pieces for curve in curves]),
        np.array([4.0, 2.0]),
        measured,
        np.zeros(2),
    )
    assert targets.at(np.zeros(2)) == pytest.approx(measured)
    blended = np.array([4.0, 2.0]) * BLEND_SHARE
    wanted = [curve.sample(time) for curve, time in zip(curves, blended, strict=True)]
    assert targets.at(blended) == pytest.approx(np.array(wanted))
    ahead = targets.at(np.array([[3.0, 9.0], [1.5, 9.0]]))  # two moments of each robot
    assert ahead[0] == pytest.approx(curves[0].sample(np.array([3.0, 9.0])))
    assert ahead[1] == pytest.approx(curves[1].sample(np.array([1.5, 9.0])))
