from types import SimpleNamespace

import pytest

from humanoid_getup.experiments.judging.summary import (
    Quantiles,
    RiseSummary,
    summarize,
    wilson_interval,
)


def test_wilson_interval_is_the_textbook_one():
    # 57 of 60, by hand: center (0.95 + 0.03201) / 1.06402, half width 0.05769.
    low, high = wilson_interval(57, 60)
    assert low == pytest.approx(0.8630, abs=5e-4)
    assert high == pytest.approx(0.9829, abs=5e-4)
    assert wilson_interval(20, 20) == pytest.approx((0.8389, 1.0), abs=5e-4)
    assert wilson_interval(0, 0) == (0.0, 1.0)


def test_a_summary_leaves_out_what_is_no_number():
    assert summarize([1.0, None, 3.0, float("nan")]) == Quantiles(median=2.0, p95=2.9)
    assert summarize([None]) == Quantiles()


def test_rises_are_counted():
    nothing = dict.fromkeys(RiseSummary.__struct_fields__)
    rises = [
        SimpleNamespace(
            **nothing | {"stood": True, "planned": True, "stand_time_s": 2.0, "self_collisions": 2}
        ),
        SimpleNamespace(**nothing | {"stood": False, "planned": True, "self_collisions": 1}),
    ]
    summary = RiseSummary.of(rises)
    assert (summary.n, summary.planned, summary.stood) == (2, 2, 1)
    assert summary.stand_time_s.median == 2.0
    assert summary.self_collisions == 3
