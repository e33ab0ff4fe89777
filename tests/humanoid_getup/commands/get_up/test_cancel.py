"""A command that is cancelled ends between two pieces, and leaves nothing half-written."""

from pathlib import Path

import pytest

from humanoid_getup.commands.get_up.rise import RiseRequest, rise
from humanoid_getup.commands.learn.evaluate import EvaluateRequest, evaluate
from humanoid_getup.commands.motions.build_motions import BuildRequest, build_motions
from humanoid_getup.commands.plan.plan_path import PlanRequest, plan
from humanoid_getup.commands.robot.check_robot import CheckRequest, check_robot
from humanoid_getup.progress.callback import CancelledError, Progress


class Stop:
    """Cancels after so many reports."""

    def __init__(self, reports: int) -> None:
        self.left = reports
        self.phases: list[str] = []

    def report(self, progress: Progress) -> None:
        self.left -= 1
        self.phases.append(progress.phase)

    def is_wanted(self) -> bool:
        return self.left <= 0


def test_a_cancelled_command_ends_with_the_piece():
    for work, request in (
        (check_robot, CheckRequest(robot="op3")),
        (plan, PlanRequest(origin="prone")),
    ):
        for reports in (1, 2):
            stop = Stop(reports)
            with pytest.raises(CancelledError):
                work(request, stop.report, stop.is_wanted)
            assert len(stop.phases) == reports


def test_a_rise_is_cancelled_while_it_is_planned(tmp_path: Path):
    phases = list[str]()
    request = RiseRequest(origin="supine", out=tmp_path)
    is_planned = "tracking 3 candidates in physics"
    with pytest.raises(CancelledError):
        rise(request, lambda each: phases.append(each.phase), lambda: is_planned in phases)
    assert phases[-1] == is_planned
    assert list(tmp_path.iterdir()) == []


def test_a_cancelled_build_ends_its_workers_and_keeps_no_motion(copied_op3: Path):
    before = sorted(copied_op3.rglob("*"))
    request = BuildRequest(names=("squat_to_stand",), robot=str(copied_op3), engine="local:1")
    stop = Stop(1)
    with pytest.raises(CancelledError):
        build_motions(request, stop.report, stop.is_wanted)
    assert stop.phases == ["squat_to_stand"]
    assert sorted(copied_op3.rglob("*")) == before


@pytest.mark.parametrize("phase", ["falls (flat)", "rises (flat)"])
def test_an_evaluation_is_cancelled_while_falls_are_sampled_and_while_robots_rise(phase: str):
    done: list[float] = []

    def report(progress: Progress) -> None:
        if progress.phase == phase:
            done.append(progress.done)

    request = EvaluateRequest(policy="quick", n=4)
    with pytest.raises(CancelledError):
        evaluate(request, report, lambda: len(done) == 2)
    assert done[0] == 0.0
    assert done[1] < 4.0 or phase.startswith("falls")
