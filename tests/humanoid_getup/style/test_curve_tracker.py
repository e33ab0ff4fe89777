"""Robots are tracked along curves of their own, and begin again where they have lost them."""

import numpy as np
import pytest

from humanoid_getup.style.curve_tracker import MOST_DEVIATION_TIME, CurveTracker
from humanoid_getup.style.style_file import load_style
from robots import Robot

STEP = 0.05  # s
LYING = np.array([0.3, np.pi / 2, 0.3])


@pytest.fixture
def tracker(op3: Robot) -> CurveTracker:
    """Two robots on the curves of a long-sit; both lie on their backs."""
    made = CurveTracker(op3, 2)
    made.features = np.tile(LYING, (2, 1))
    made.begin(np.arange(2), [load_style("long-sit", op3).curves[0]] * 2)
    return made


def go_on(tracker: CurveTracker, choose) -> list[np.ndarray]:
    """The first robot goes on lying; the second does as it is asked to."""
    again = []
    for _ in range(round(tracker.duration[0] / STEP)):
        tracker.advance(STEP)
        tracker.features = np.array([LYING, tracker.wanted[1]])
        again.append(tracker.restart_deviating(STEP, choose))
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
    assert asked == [(0, LYING.tolist())]
    assert tracker.duration == pytest.approx([push_up.duration, duration])
    since = (len(again) - 1 - first) * STEP
    assert tracker.time[0] == pytest.approx(since)
    assert tracker.time[1] == pytest.approx(len(again) * STEP)
    # It was half a second beyond the limit, not less.
    assert first * STEP > MOST_DEVIATION_TIME


def test_curves_that_begin_far_from_a_robot_do_not_help_it(op3, tracker):
    prone = load_style("push-up", op3).curves[2]
    again = go_on(tracker, lambda *_: prone)
    assert not any(len(ids) for ids in again)
    assert tracker.time == pytest.approx([len(again) * STEP] * 2)


def test_a_robot_that_stands_is_not_asked_to_lie_down(op3):
    tracker, curves = CurveTracker(op3, 2), load_style("long-sit", op3).curves[0]
    tracker.features = np.array([LYING, [0.97, 1.5, 1.6]])
    tracker.begin(np.arange(2), [curves, curves])
    assert tracker.time == pytest.approx([0.0, curves.duration])
    tracker.advance(0.2)
    assert tracker.wanted[1] == pytest.approx(curves.points[-1])
