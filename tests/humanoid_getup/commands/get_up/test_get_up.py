"""Jobs that get a robot up: files and figures of the commands, cancellation, other processes."""

import json
import pickle
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from bus_stories import TINY
from rise_figures_of import WALL_TIMES
from stored_plans import plan_stored

import humanoid_getup as hg
from drivers import SafetyGuard, Twin
from drivers.flight_log.reader import FlightRecord
from humanoid_getup.commands.errors import BadInputError
from humanoid_getup.commands.get_up.session_hooks import NoOperator
from humanoid_getup.commands.main import main
from humanoid_getup.execution.session import Phase
from humanoid_getup.reporting import film_strip
from humanoid_getup.strategies.planned_rise import PlannedRise
from robots.storage.encoding import to_json

SQUAT = "squat_to_stand"


class Watch(NoOperator):
    """An operator that only watches, and knows whether a robot has ended its work."""

    def __init__(self) -> None:
        self.guard: SafetyGuard | None = None
        self.has_ended = False

    @contextmanager
    def watch(self, guard: SafetyGuard) -> Iterator[None]:
        self.guard = guard
        yield
        self.has_ended = True

    @property
    def has_torque(self) -> bool:
        assert self.guard is not None
        twin = self.guard.backend
        assert isinstance(twin, Twin)
        return bool(twin.model.actuator_forcerange.any())


class Stop:
    """Cancels at a phase, after some further calls."""

    def __init__(self, phase: str, calls: int = 0) -> None:
        self._phase, self._left = phase, calls
        self.phases: list[str] = []

    def report(self, progress: hg.Progress) -> None:
        self.phases.append(progress.phase)

    def is_wanted(self) -> bool:
        is_there = self._phase in self.phases
        self._left -= is_there
        return is_there and self._left < 0


@pytest.fixture(scope="module", autouse=True)
def quick() -> Iterator[None]:
    """Plan stored motions, and draw no film strips."""

    def refuse(*_: object, **__: object) -> None:
        raise film_strip.NoRendererError("not drawn in this test")

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(PlannedRise, "plan", plan_stored)
        patch.setattr(film_strip, "render_frames", refuse)
        yield


def test_a_rise_writes_the_files_of_the_command_and_returns_its_figures(lying: str, tmp_path: Path):
    phases, ours, theirs = list[str](), tmp_path / "ours", tmp_path / "theirs"
    request = hg.RiseRequest(origin=lying, out=ours)
    done = hg.rise(request, lambda progress: phases.append(progress.phase))
    during = (Phase.SETTLING, Phase.PLANNING, Phase.PREFLIGHT, Phase.PLAYING)
    expected = ["loading", "opening the backend", *(phase.value for phase in during), "drawing"]
    assert phases == expected
    assert done.rise.stood

    assert main(["rise", "--from", lying, "--out", str(theirs)]) == 0
    assert sorted(done.files) == sorted(ours.iterdir())
    names = sorted(path.name for path in done.files)
    assert {"flight.mcap", "motion.npz", "report.json"} <= set(names)
    assert names == sorted(path.name for path in theirs.iterdir())
    mine = (ours / "report.json").read_text()
    assert mine == to_json(done.report)
    figures, others = (
        {key: value for key, value in json.loads(text).items() if key not in WALL_TIMES}
        for text in (mine, (theirs / "report.json").read_text())
    )
    assert figures == others

    again = pickle.loads(pickle.dumps(done))
    assert (again.report, again.files) == (done.report, done.files)
    assert str(again.rise) == str(done.rise)
    assert np.array_equal(again.rise.outcome.qpos, done.rise.outcome.qpos)
    assert again.world.model.nq == done.world.model.nq


@pytest.mark.parametrize(
    ("phase", "calls"),
    [
        ("opening the backend", 0),
        (Phase.SETTLING.value, 3),
        (Phase.PREFLIGHT.value, 0),
        (Phase.PLAYING.value, 40),
        ("drawing", 0),
    ],
)
def test_a_cancelled_rise_ends_limp_and_leaves_no_result(
    lying: str, tmp_path: Path, phase: str, calls: int
):
    out, stop, operator = tmp_path / "out", Stop(phase, calls), Watch()
    request = hg.RiseRequest(origin=lying, out=out)
    with pytest.raises(hg.CancelledError):
        hg.rise(request, stop.report, stop.is_wanted, operator=operator)
    assert stop.phases[-1] == phase
    assert operator.guard is None or not operator.has_torque
    has_flown = phase in (Phase.PLAYING.value, "drawing")
    assert [path.name for path in tmp_path.rglob("*.*")] == ["flight.mcap"] * has_flown
    if phase == Phase.PLAYING.value:
        flight = FlightRecord.load(out / "flight.mcap")
        assert len(flight.time) == calls - 1  # one is that of the phase
        assert flight.events[-1].text == "CancelledError: cancelled"


def test_a_robot_that_was_handed_over_is_no_longer_cancelled():
    operator = Watch()
    request = hg.HoldRequest(then="hand-over")
    done = hg.hold(request, cancel=lambda: operator.has_ended, operator=operator)
    assert done.stand.hand_over is not None
    assert operator.has_torque
    assert (done.report.reason[-24:], done.files) == ("handed over under torque", ())


def test_work_that_is_refused_is_bad_input():
    with pytest.raises(BadInputError, match="robot 'tiny' has no motions"):
        hg.sit(hg.SitRequest(robot=str(TINY)))
    with pytest.raises(BadInputError, match="request is a SitRequest, expected a HoldRequest"):
        hg.hold(hg.SitRequest())
