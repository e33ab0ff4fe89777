"""The plot of a whole benchmark: rates with intervals, times of the rises that stood."""

import numpy as np
import pytest

from humanoid_getup.benchmarks.whole import CapSummary
from humanoid_getup.experiments.judging.summary import SummarizedRise
from humanoid_getup.reporting import benchmark_page
from humanoid_getup.reporting.benchmark_page import save_benchmark


def case(method: str, cap: str, stood: int, median: float | None) -> CapSummary:
    rises = [SummarizedRise(stood=k < stood, planned=True, stand_time_s=median) for k in range(10)]
    return CapSummary.of(
        rises,
        method=method,
        cap=cap,
        share_of_stall=1.0,
        torque_limit_nm=None,
        limit_by=None,
        classes={},
    )


def test_methods_have_a_point_for_each_cap(tmp_path, monkeypatch: pytest.MonkeyPatch):
    saved = []
    monkeypatch.setattr(benchmark_page, "save_figure", lambda figure, _: saved.append(figure))
    cases = [
        case("plan", "stall", 9, 3.0),
        case("plan", "50%", 5, 4.0),
        case("quick", "stall", 8, 2.0),
        case("quick", "50%", 0, None),
    ]
    save_benchmark(cases, tmp_path / "plot.png")
    stands, times = saved[0].axes
    assert [tick.get_text() for tick in stands.get_xticklabels()] == ["stall", "50%"]
    rates = [bars.lines[0].get_ydata() for bars in stands.containers]
    assert np.array(rates) == pytest.approx(np.array([[90.0, 50.0], [80.0, 0.0]]))
    medians = [bars.lines[0].get_ydata() for bars in times.containers]
    assert medians[0] == pytest.approx([3.0, 4.0])
    assert medians[1] == pytest.approx([2.0, np.nan], nan_ok=True)
    assert [text.get_text() for text in saved[0].legends[0].get_texts()] == ["plan", "quick"]
