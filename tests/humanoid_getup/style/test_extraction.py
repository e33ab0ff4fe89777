"""Curves are extracted from what was measured: its moving part, at nine equally spaced times."""

import numpy as np
import pytest

from humanoid_getup.simulation.world import World
from humanoid_getup.style.extraction import (
    ExtractionError,
    extract_curves,
    measure_features,
    trim,
)
from robots import Robot, quaternion
from robots.kinematics import place

RIGHT = np.pi / 2
T = 101


def rise(before: int = 0, after: int = 0) -> np.ndarray:
    """Features of an even rise from the back, (T, 3), with still samples before and after."""
    share = np.concatenate([np.zeros(before), np.linspace(0.0, 1.0, T), np.ones(after)])
    up = np.array([1.0, RIGHT, RIGHT])
    return np.array([0.2, RIGHT, 0.0]) + share[:, None] * (up - [0.2, RIGHT, 0.0])


def test_a_stand_has_the_standing_height_and_leans_as_the_stance_does(op3: Robot, world: World):
    qpos = place(op3, world.model, op3.standing)[None]
    lean = quaternion.angle_between(op3.standing.orientation, quaternion.IDENTITY)
    expected = np.array([[1.0, RIGHT, RIGHT + float(lean)]])
    assert 0.0 < lean < 0.2
    assert measure_features(op3, world.model, qpos) == pytest.approx(expected, abs=1e-6)


def test_what_is_still_at_both_ends_is_trimmed():
    kept = trim(rise(before=40, after=60))
    assert 40 <= kept.start <= 46
    assert 134 <= kept.stop <= 142
    with pytest.raises(ExtractionError, match="nothing moves"):
        trim(rise()[-1:].repeat(9, axis=0))


def test_curves_pass_through_the_features_at_nine_times():
    time = 5.0 + np.linspace(0.0, 2.0, T)
    curves = extract_curves(time, rise())
    assert curves.duration == pytest.approx(2.0)
    even = np.linspace(0.0, 1.0, 9)[:, None]
    assert curves.points == pytest.approx((1.0 - even) * rise()[0] + even * rise()[-1])


@pytest.mark.parametrize(
    ("features", "message"),
    [
        (rise()[:60], r"the neck ends at 0\.\d+ of its standing height, expected"),
        (rise()[:, :2], r"features have shape \(101, 2\), expected \(101, 3\)"),
    ],
)
def test_what_is_no_rise_is_refused(features: np.ndarray, message: str):
    with pytest.raises(ExtractionError, match=message):
        extract_curves(np.arange(len(features)) * 0.02, features)
