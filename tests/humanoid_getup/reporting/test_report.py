"""The report: every key in every report, figures that any JSON reader takes."""

import io
import re
from dataclasses import fields
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from msgspec import UNSET
from rich.console import Console

from humanoid_getup.execution.rise import Attempt, AttemptStatus, Rise
from humanoid_getup.experiments.judging.torque import split_torque
from humanoid_getup.reporting import plots
from humanoid_getup.reporting.plots import save_torque
from humanoid_getup.reporting.report import ReportHead, RiseReport, print_summary
from humanoid_getup.strategies.plan import Plan, RiseStatus
from robots import Robot, load_robot
from robots.storage.encoding import to_plain

HEAD = ReportHead(
    robot="op3",
    identified="",
    body="",
    load=None,
    seed=4,
    start="prone",
    scene="flat",
    backend="twin",
    torque_limit_nm=2.5,
    limit_by="current",
    then="limp",
    unreleased_joints=(),
)
FIELDS = fields(RiseReport)
PAGE = Path(__file__).parents[3] / "docs/reference/report.md"
NO_PLAN = Plan(status=RiseStatus.NOT_PLANNED, plan_s=0.1)
UNPLANNED = Rise(
    robot=load_robot("op3"),
    start_class="prone",
    status=AttemptStatus.NEEDS_HELP,
    reason="no path to any connecting posture",
    attempts=(Attempt(number=1, start_class="prone", plan=NO_PLAN),),
)
REPORT = RiseReport(**vars(UNPLANNED.figures()), **vars(HEAD))


def test_a_rise_that_was_never_played_has_every_key_and_says_why():
    report = to_plain(REPORT)
    assert report.keys() >= {field.name for field in FIELDS if field.default is not UNSET}
    assert (report["robot"], report["seed"], report["torque_limit_nm"]) == ("op3", 4, 2.5)
    assert (report["planned"], report["stood"], report["attempts"]) == (False, False, 0)
    assert report["reason"] == "no path to any connecting posture"
    for key in ("stand_time_s", "peak_torque_nm", "peak_velocity_rad_s", "torque_use"):
        assert report[key] is None


def test_every_key_is_documented():
    assert {field.name for field in FIELDS} <= set(re.findall(r"`(\w+)`", PAGE.read_text("utf-8")))


def test_a_summary_gives_the_reason_when_there_is_no_stand():
    page = io.StringIO()
    print_summary(REPORT, [], Console(file=page, width=100))
    lines = page.getvalue().splitlines()
    assert lines[0] == "did not stand: no path to any connecting posture"
    assert lines[1].split() == ["start", "prone,", "seed", "4"]
    assert len(lines) == 2


T = 50


@pytest.fixture
def figures(monkeypatch: pytest.MonkeyPatch) -> list:
    saved: list = []
    monkeypatch.setattr(plots, "save_figure", lambda figure, _path: saved.append(figure))
    return saved


def test_driving_and_braking_torque_are_apart(figures: list, tmp_path, tiny: Robot):
    """The first joint drives with 1 N·m, the second brakes with 2 N·m."""
    torque, speed = np.tile([1.0, -2.0], (T, 1)), np.tile([1.0, 1.0], (T, 1))
    torques = split_torque(torque, speed)
    outcome = SimpleNamespace(torques=torques, stood=True, stand_time=0.2)
    save_torque(tiny, outcome, 1.5, tmp_path / "plot.png")
    (axis,) = figures[0].axes
    lines = {line.get_label(): line.get_ydata() for line in axis.get_lines()}
    assert lines["l_hip"] == pytest.approx(np.ones(T))
    assert lines["r_hip"] == pytest.approx(np.zeros(T))
    assert lines["braking, any"] == pytest.approx(np.full(T, 2.0))
    assert [text.get_text() for text in axis.texts] == ["limit 1.5 N·m", " stands"]
