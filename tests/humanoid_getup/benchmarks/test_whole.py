"""The whole benchmark: parts that depend on what they say, and add up."""

from dataclasses import replace

import pytest
from msgspec import convert

from humanoid_getup.benchmarks.bench_result import KeptRise
from humanoid_getup.benchmarks.part import MethodRises, Part
from humanoid_getup.benchmarks.rise_method import RiseMethod
from humanoid_getup.benchmarks.torque_cap import make_caps
from humanoid_getup.benchmarks.whole import Whole, sample_by_class, summarize_parts
from humanoid_getup.experiments.judging.summary import wilson_interval
from humanoid_getup.experiments.starts.falls import CLASSES
from humanoid_getup.jobs.run_parts import open_part, read_result, run_part, run_parts
from humanoid_getup.motions.motion_database import find_motion
from humanoid_getup.progress.callback import ProgressMonitor
from humanoid_getup.reporting.benchmark_page import write_page
from humanoid_getup.reporting.benchmark_plot import save_benchmark
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.plan import RisePlan, RiseStatus
from humanoid_getup.strategies.stored_motion import StoredMotion
from robots.storage.encoding import as_kept

MOTION = "prone_push_up_gentle"


class NothingPlanned:
    """A way of getting up that finds nothing to do, and says what it drew."""

    def __init__(self, world, limit):
        self.world, self.torque_limit = world, limit

    def plan(self, _start, rng):
        return RisePlan(status=RiseStatus.NOT_PLANNED, detail=str(rng.random()))


@pytest.fixture(scope="module")
def whole(op3, world):
    motion = find_motion(op3, MOTION)
    return Whole(
        world=world,
        methods=[
            RiseMethod(
                name="push up",
                make=lambda place, limit: StoredMotion(place, motion, torque_limit=limit),
                fingerprint="1",
                preflight=False,
            ),
            RiseMethod(
                name="nothing",
                make=NothingPlanned,
                fingerprint="2",
            ),
        ],
        motions=[motion],
        caps=make_caps(op3, "pwm", (1.0, 0.61)),
        planner=None,
        policies={},
        disturbances=(),
        seed=4,
        each=1,
    )


@pytest.fixture(scope="module")
def results(whole):
    steps = {}
    results = {}
    for part in whole.parts():
        seen = []
        results[part.name] = convert(as_kept(part.run(seen.append)), part.kind)
        steps[part.name] = (len(seen), part.count)
    assert all(done == count for done, count in steps.values()), steps
    return results


@pytest.fixture(scope="module")
def summary(whole, results):
    return summarize_parts(whole, results, notes=["This robot flies."], command="getup bench all")


def test_every_method_gets_the_same_falls_under_every_cap(results):
    rises = [one.rises for one in results.values() if isinstance(one, MethodRises)]
    assert len(rises) == 4
    assert {tuple(rise.start_class for rise in some) for some in rises} == {CLASSES}


def test_the_summary_counts_what_the_rises_say(results, summary):
    for name, case in summary.cases.items():
        stood = [rise.stood for rise in results[name].rises]
        assert (case.n, case.stood) == (4, sum(stood)), name
        assert case.stood_interval_95 == wilson_interval(sum(stood), 4)
        assert [c.stood for c in case.classes.values()] == stood
    assert summary.cases["push up, stall torque"].classes["prone"].stood == 1
    assert summary.cases["nothing, 61%"].stood == 0
    assert summary.cases["nothing, 61%"].torque_limit_nm == 2.5


@pytest.mark.parametrize(("method", "name"), [(0, "push up"), (1, "nothing")])
def test_a_rise_that_is_repeated_is_the_same(whole, results, method, name):
    again = whole.repeat(whole.methods[method], 1).figures()
    before = results[f"{name}, stall torque"].rises[1]
    kept = convert(again, KeptRise, from_attributes=True)
    assert replace(kept, bench_class=before.bench_class) == before


def test_a_part_depends_on_what_changes_its_result(whole):
    first = {part.name: part.depends for part in whole.parts()}
    for changed, among in (
        (replace(whole, seed=5), first),
        (replace(whole, each=2), first),
        (replace(whole, methods=[replace(whole.methods[0], fingerprint="3")]), ["push up, 61%"]),
    ):
        other = {part.name: part.depends for part in changed.parts()}
        assert all(other[name] != first[name] for name in among)
    assert {part.name: part.depends for part in whole.parts()} == first


def test_a_run_that_was_interrupted_ends_as_one_that_was_not(whole, results, tmp_path):
    parts = replace(whole, methods=whole.methods[1:]).parts()
    for part in parts[::2]:
        run_part(part, open_part(tmp_path / "parts", part, resume=True), lambda _: None)
    ledgers = [open_part(tmp_path / "parts", part, resume=True) for part in parts]
    for part, ledger in zip(parts, ledgers, strict=True):
        if not ledger.done:
            run_part(part, ledger, lambda _: None)
    resumed = [
        read_result(part, open_part(tmp_path / "parts", part, resume=True)) for part in parts
    ]
    assert len(parts) >= 3
    assert resumed == [results[part.name] for part in parts]
    assert len(list((tmp_path / "parts").iterdir())) == len(parts)


def test_a_run_that_starts_over_deletes_its_own_parts_alone(tmp_path):
    old, new = (MethodRises(classes=classes, missing={}, rises=[]) for classes in ((), ("prone",)))
    part = Part(name="one", count=0, depends={}, kind=MethodRises, run=lambda _: new)
    open_part(tmp_path, part, resume=False).add("result", old)
    (tmp_path / "notes.jsonl").write_text("mine")
    assert run_parts([part], tmp_path, ProgressMonitor(), resume=False) == {"one": new}
    assert (tmp_path / "notes.jsonl").read_text() == "mine"


def test_classes_in_which_a_robot_never_lies_are_left_out_with_the_reason(op3):
    falls = sample_by_class(World(op3, "beam"), 1, seed=0)
    assert falls.classes == ("prone",)
    assert [fall.start_class for fall in falls.falls] == ["prone"]
    assert sorted(falls.missing) == ["left", "right", "supine"]
    assert "no start supine" in falls.missing["supine"]


def test_the_page_has_every_figure_and_how_to_repeat_it(summary, tmp_path):
    save_benchmark(list(summary.cases.values()), tmp_path / "benchmark.png")
    assert (tmp_path / "benchmark.png").read_bytes().startswith(b"\x89PNG")
    page = write_page(summary)
    rows = [line for line in page.splitlines() if line.startswith("| ")]
    for case in summary.cases.values():
        assert sum(line.startswith(f"| {case.method} | {case.cap}") for line in rows) == 3
    low, high = wilson_interval(0, 4)
    assert f"| nothing | 61%, 2.5 N·m | 0 of 4 ({low:.0%} to {high:.0%}) | –" in page
    for text in ("This robot flies.", "20 × XM430-W350", "12 V", MOTION, summary.command, "pwm"):
        assert text in page
    assert all(line.count("|") == rows[0].count("|") for line in rows[:6])
