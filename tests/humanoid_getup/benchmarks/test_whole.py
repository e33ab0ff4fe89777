"""The whole benchmark: every method gets the same falls, and the summary adds up."""

from functools import partial

import mujoco
import pytest

from humanoid_getup.benchmarks.whole import (
    Whole,
    WholeBench,
    describe_conditions,
    make_caps,
    sample_by_class,
    select_rises,
    summarize_rises,
)
from humanoid_getup.experiments.falls import CLASSES
from humanoid_getup.experiments.judging.summary import wilson_interval
from humanoid_getup.motions.motion_database import find_motion
from humanoid_getup.reporting.benchmark_page import save_benchmark, write_page
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.plan import Plan, RiseStatus
from humanoid_getup.strategies.stored_motion import StoredMotion
from robots import Robot, TorqueLimit

MOTION = "prone_push_up_gentle"


class NothingPlanned:
    def __init__(self, world, limit):
        self.world, self.torque_limit = world, limit

    def plan(self, _start, _rng):
        return Plan(status=RiseStatus.NOT_PLANNED)


@pytest.fixture(scope="module")
def whole(op3, world):
    motion = find_motion(op3, MOTION)
    return Whole(
        world=world,
        methods={
            "nearest": lambda limit: StoredMotion(world, motion, torque_limit=limit),
            "nothing": partial(NothingPlanned, world),
        },
        caps=make_caps(op3, "pwm", (1.0, 0.61)),
        seed=4,
        each=1,
    )


@pytest.fixture(scope="module")
def rises(whole):
    return {name: whole.do(piece) for name, piece in whole.list_rises().items()}


@pytest.fixture(scope="module")
def summary(whole, rises):
    return WholeBench(
        seed=4,
        n=1,
        robot="op3",
        body="",
        scene="flat",
        cases=summarize_rises(whole, rises),
        missing_classes={},
        notes=["This robot flies."],
        command="getup bench all",
        conditions=describe_conditions(whole.world, whole.caps[0].limit),
    )


def test_every_method_gets_the_same_falls_under_every_cap(whole, rises):
    groups = [select_rises(rises, method, cap) for method in whole.methods for cap in whole.caps]
    assert len(groups) == 4
    assert {tuple(rise.start_class for rise in some) for some in groups} == {CLASSES}


def test_the_summary_counts_what_the_rises_say(whole, rises, summary):
    for cap in whole.caps:
        case = summary.cases[f"nearest, {cap.name}"]
        stood = [rise.stood for rise in select_rises(rises, "nearest", cap)]
        assert (case.n, case.stood) == (4, sum(stood))
        assert case.stood_interval_95 == wilson_interval(sum(stood), 4)
        assert [one.stood for one in case.classes.values()] == stood
    assert summary.cases["nearest, stall torque"].classes["prone"].stood == 1
    assert summary.cases["nothing, 61%"].stood == 0
    assert summary.cases["nothing, 61%"].torque_limit_nm == 2.5


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
    for text in (
        "**Not measured.** This robot flies.",
        "20 × XM430-W350",
        "12 V",
        summary.command,
        "pwm",
    ):
        assert text in page
    assert all(line.count("|") == rows[0].count("|") for line in rows[:6])


def test_conditions_are_those_of_robot_and_world(op3: Robot, world: World):
    about = describe_conditions(world, TorqueLimit(2.0, "current").on(op3))
    assert about.servos == {"XM430-W350": 20}
    assert about.mass_kg == pytest.approx(3.147, abs=0.001)  # of the maker's description
    assert about.stall_torque_nm == pytest.approx(4.1)
    assert (about.joints, about.scene, about.limit_by) == (20, "flat", "current")
    assert about.mujoco == mujoco.__version__
