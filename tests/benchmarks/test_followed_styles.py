"""How well styles are followed: only rises that stand before and after count for an edit."""

import numpy as np
import pytest
from benchmark_scripts import load_script

from humanoid_getup.style.edits import rise_time

pytest.importorskip("torch")  # which the curves of a training need


STEP = 0.048  # s


@pytest.fixture(scope="module")
def bench():
    return load_script("followed_styles")


def test_an_edit_is_judged_by_rises_that_stand_with_and_without_it(bench, op3, world):
    falls = bench.sample_fall_set(world, {"prone": 2, "supine": 2}, 0)
    lying = np.array([[0.2, 1.57, 2.9], [0.2, 1.57, 2.9], [0.3, 1.57, 0.3], [0.3, 1.57, 0.3]])
    asked: list[float] = []

    def follow(_starts, choose):
        """The first robot never stands; the others rise as asked, the last one by half."""
        times = np.array([rise_time(choose(row, lying[row])) for row in range(4)])
        asked.append(times[3])
        times[3] = asked[0] + 0.5 * (asked[-1] - asked[0])
        stood = np.array([False, True, True, True])
        return bench.Followed(stood, np.zeros(4), np.zeros(4), np.array([0, 0, 0, 0]), STEP, times)

    follow.robot = op3
    rows = bench.measure_edits(follow, falls)
    assert [row["asked_s"] for row in rows] == list(bench.SHIFTS)
    for row in rows:
        assert (row["n"], row["stood"], row["within_10_percent"]) == (3, 3, 2)
        assert row["moved_s_median"] == pytest.approx(row["asked_s"], abs=1e-4)


def test_errors_are_medians_of_all_rises_of_a_class(bench):
    height, angle = np.array([0.1, 0.2, 0.9]), np.array([1.0, 2.0, 30.0])
    again, times = np.zeros(3, dtype=int), np.zeros(3)
    rows = bench.Followed(np.array([True, True, False]), height, angle, again, STEP, times)
    assert rows.summarize()["height_error"] == 0.2
    some = rows.summarize(np.array([True, False, True]))
    assert some == {"n": 2, "stood": 1, "height_error": 0.5, "angle_error_deg": 15.5}
