"""Robots are tracked along curves; errors count while these last and say if they were followed."""

import math

import numpy as np
import pytest

from humanoid_getup.style.curve_tracker import MOST_DEVIATION_TIME, CurveTracker
from humanoid_getup.style.curves import UPRIGHT_STAND, StyleCurves
from humanoid_getup.style.followed_style import FollowedStyle, StyleErrors, weigh
from humanoid_getup.style.style import load_named, load_style
from robots import Robot

STEP = 0.5  # s
LYING = np.array([0.3, math.pi / 2, 0.2])


def rise(duration: float) -> StyleCurves:
    """Make curves from lying to standing, in nine equal steps."""
    points = LYING + np.linspace(0.0, 1.0, 9)[:, None] * (UPRIGHT_STAND - LYING)
    return StyleCurves.of(points, duration)


def test_errors_count_while_the_curves_last():
    """Of two robots whose curves last for 4 and for 2 of 4 policy steps."""
    curves = [rise(4 * STEP), rise(2 * STEP)]
    errors = StyleErrors(curves, np.tile(LYING, (2, 1)), np.zeros(2))
    off = np.array([0.1, 0.2, -0.3, 0.4])
    for k, error in enumerate(off, start=1):
        wanted = np.array([curve.sample(np.array(k * STEP)) for curve in curves])
        errors.note(wanted + error * np.array([1.0, 2.0, 3.0]), STEP)
    assert errors.mean[0] == pytest.approx(0.25 * np.array([1.0, 2.0, 3.0]))
    assert errors.mean[1] == pytest.approx(0.15 * np.array([1.0, 2.0, 3.0]))


def test_a_rise_that_is_cut_off_has_followed_only_a_share():
    errors = StyleErrors([rise(4 * STEP)], LYING[None], np.zeros(1))
    for k in (1, 2, 3):
        errors.note(rise(4 * STEP).sample(np.array([[k * STEP]]))[0], STEP)
        followed = FollowedStyle.of(errors, rise(4 * STEP), LYING, 0)
        assert followed.share == pytest.approx(k / 4)
        assert not followed.was_followed
    errors.note(UPRIGHT_STAND[None], STEP)
    assert FollowedStyle.of(errors, rise(4 * STEP), LYING, 0).was_followed


def test_a_style_that_was_not_asked_for_is_nearest_where_it_was_done(op3: Robot):
    """One robot does what it is asked to, one another style, one a style like the asked one."""
    asked, done = load_style("side-sit", op3), load_style("long-sit", op3)
    named = load_named(op3)
    for start, expected in ((0, ["", "long-sit"]), (2, ["", ""])):
        given = asked.curves[start]
        curves, time = [given, given], np.linspace(0.0, 1.0, 41)[1:]
        errors = StyleErrors(curves, np.tile(given.values[0], (2, 1)), np.zeros(2))
        for share in time:
            seen = [given.sample(share * given.duration)]
            seen.append(done.curves[start].sample(share * done.curves[start].duration))
            errors.note(np.array(seen), given.duration / 40)
        assert errors.find_nearest(named).tolist() == expected
        assert weigh(errors.mean)[0] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(
    ("facts", "is_followed", "text"),
    [
        ((0.03, 5.0, 0, 10.0, 1.0), True, "followed, mean errors 0.03 of the height and 5°"),
        ((0.12, 15.0, 0, 10.0, 1.0), False, "not followed, mean errors 0.12 of the height and 15°"),
        ((0.03, 5.0, 1, 10.0, 1.0), False, "; restarted once on curves nearer to how it lay then"),
        ((0.2, 43.0, 0, 150.0, 1.0), False, "; the curves begin 150° from how it lay"),
        ((0.0, 0.0, 0, 10.0, 0.1), False, "not followed, ended after 10% of its curves, mean"),
        ((math.nan, math.nan, 0, 10.0, 0.0), False, "not followed, ended after 0% of its curves"),
    ],
)
def test_it_is_said_whether_curves_were_followed(facts, is_followed, text):
    height, angle, restarts, off, share = facts
    followed = FollowedStyle(
        height_error=height,
        angle_error=math.radians(angle),
        share=share,
        restarts=restarts,
        start_error=math.radians(off),
    )
    assert text in str(followed)
    assert followed.was_followed is is_followed
    assert str(followed).startswith("followed") == is_followed
    assert followed.figures().style_restarts == restarts


PERIOD = 0.05  # s
ON_ITS_BACK = np.array([0.3, np.pi / 2, 0.3])


@pytest.fixture
def tracker(op3: Robot) -> CurveTracker:
    """Two robots on the curves of a long-sit; both lie on their backs."""
    made = CurveTracker(op3, 2)
    made.features = np.tile(ON_ITS_BACK, (2, 1))
    made.begin(np.arange(2), [load_style("long-sit", op3).curves[0]] * 2)
    return made


def go_on(tracker: CurveTracker, choose) -> list[np.ndarray]:
    """The first robot goes on lying; the second does as it is asked to."""
    again = []
    for _ in range(round(tracker.duration[0] / PERIOD)):
        tracker.advance(PERIOD)
        tracker.features = np.array([ON_ITS_BACK, tracker.wanted[1]])
        again.append(tracker.restart_deviating(PERIOD, choose))
    return again


def test_only_a_robot_that_has_deviating_its_curves_begins_again(op3, tracker):
    push_up, duration = load_style("push-up", op3).curves[0], tracker.duration[1]
    asked = []

    def choose(row, features):
        asked.append((row, features.tolist()))
        return push_up

    again = go_on(tracker, choose)
    (first,) = [k for k, ids in enumerate(again) if len(ids)]
    assert again[first].tolist() == [0]
    assert asked == [(0, ON_ITS_BACK.tolist())]
    assert tracker.duration == pytest.approx([push_up.duration, duration])
    since = (len(again) - 1 - first) * PERIOD
    assert tracker.time[0] == pytest.approx(since)
    assert tracker.time[1] == pytest.approx(len(again) * PERIOD)
    # It was half a second beyond the limit, not less.
    assert first * PERIOD > MOST_DEVIATION_TIME


def test_a_robot_that_stands_is_not_asked_to_lie_down(op3):
    tracker, curves = CurveTracker(op3, 2), load_style("long-sit", op3).curves[0]
    tracker.features = np.array([ON_ITS_BACK, [0.97, 1.5, 1.6]])
    tracker.begin(np.arange(2), [curves, curves])
    assert tracker.time == pytest.approx([0.0, curves.duration])
    tracker.advance(0.2)
    assert tracker.wanted[1] == pytest.approx(curves.values[-1])
