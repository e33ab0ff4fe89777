"""The page of a benchmark: what was not measured comes first, and tables stay tables."""

import numpy as np
import pytest
from msgspec.structs import replace

from humanoid_getup.benchmarks.whole import CapSummary, Pictures, WholeBench, describe_conditions
from humanoid_getup.experiments.judging.summary import SummarizedRise
from humanoid_getup.reporting import benchmark_page
from humanoid_getup.reporting.benchmark_page import save_benchmark, write_page
from humanoid_getup.simulation.world import World
from robots import TorqueLimit


def make_result(world: World, **changes) -> WholeBench:
    result = WholeBench(
        name="all",
        robot="op3",
        body="",
        scene="flat",
        n=4,
        seed=7,
        notes=["It has no policies."],
        missing_classes={"lateral": "it rolls on"},
        cases={},
        motions={},
        disturbed={},
        pictures=Pictures(),
        command="getup bench all --robot op3 --seed 7",
        conditions=describe_conditions(world, TorqueLimit(2.5, "pwm").on(world.robot)),
    )
    return replace(result, **changes)


def test_a_page_without_results_says_why_and_how_to_repeat_it(world: World):
    page = write_page(make_result(world))
    lines = page.splitlines()
    assert lines[0] == "# op3: getting up, n = 4 falls of each class"
    assert "**Not measured.** It has no policies." in lines
    assert "**Not measured.** No fall ends lateral: it rolls on." in lines
    assert "getup bench all --robot op3 --seed 7" in lines
    assert "## Results" not in lines
    assert "## Pictures" not in lines


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
