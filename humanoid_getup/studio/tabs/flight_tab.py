"""Flight tab: a flight log, the measured robot and the twin that replays its commands."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from drivers.flight_log.reader import FlightRecord
from humanoid_getup.commands.errors import BadInputError
from humanoid_getup.commands.files import shorten_path
from humanoid_getup.commands.look.replay import (
    REPLAY_FILES,
    ReplayedFlight,
    ReplayRequest,
    replay_flight,
)
from humanoid_getup.commands.options import write_command
from humanoid_getup.execution.session import Phase
from humanoid_getup.reporting.replay import THRESHOLD, ReplayReport
from humanoid_getup.simulation.world import World
from humanoid_getup.studio.form import Form
from humanoid_getup.studio.page import Page
from humanoid_getup.studio.plain_text import make_block, make_table
from humanoid_getup.studio.takes import Mark, Plot, Take
from robots.kinematics import transfer_positions

SUFFIX = ".mcap"
NO_LOG = f"no {SUFFIX} file"
START = {
    "logged": "the twin starts where the log says",
    "estimated": "the twin starts where the first measurement puts it",
}
ENDED = Phase.ENDED.name.lower()
"""Kind of the event that tells how a rise ended."""
PLOTTED = 5  # joints, those that differ most
MOST_EVENTS = 100  # marks
MOST_CUTS = 20  # marks, of the longest


class FlightTab:
    """Elements that open a flight log, and show the robot and its twin."""

    def __init__(self, page: Page) -> None:
        self._page, gui = page, page.gui
        replay = partial(replay_flight, folders=page.request.folder)
        self._opening = page.add_job(replay, self._show, over=self._note_logs)
        busy = "files are being saved, expected their end"
        self._saving = page.add_job(replay, self._tell_saved, over=self._note_logs, busy=busy)
        self._opened: ReplayRequest | None = None
        with gui.add_folder("Flight log"):
            self._list = gui.add_dropdown("Log", self._find_logs())
            self._name = gui.add_text("File", "")
            page.add_button("Refresh", self._refresh)
            page.add_button("Open", self._open, main=True)
            page.add_button("Cancel", self._cancel)
        with gui.add_folder("Twin", expand_by_default=False):
            labels = {"voltage": "Supply", "threshold": "Threshold"}
            self._form = Form(gui, ReplayRequest, labels, threshold=THRESHOLD)
        with gui.add_folder("Command"):
            self._command = gui.add_markdown("")
            self._folder = gui.add_text("Folder", "replay")
            page.add_button("Save files", self._save)
        with gui.add_folder("Differences [rad]"):
            self._table = gui.add_markdown("No flight log yet.")
        self._choose()
        page.when_files_changed.append(self._note_logs)
        page.on_change(self._list, self._choose)
        page.on_change(self._folder, self._write_command)

    # Choice -----------------------------------------------------------------------------------

    def _find_logs(self) -> list[str]:
        return self._page.folders.list_files(SUFFIX) or [NO_LOG]

    def _refresh(self) -> None:
        """List the logs, and choose the newest one."""
        self._note_logs()
        self._list.value = self._list.options[0]
        self._choose()

    def _note_logs(self) -> None:
        """List the logs; the choice stays, unless there was none to choose."""
        chosen, logs = self._list.value, self._find_logs()
        if tuple(logs) != self._list.options:
            self._list.options = tuple(logs)
            self._list.value = chosen if chosen in logs else logs[0]
        if not self._name.value:
            self._choose()

    def _choose(self) -> None:
        self._name.value = "" if self._list.value == NO_LOG else self._list.value

    def _open(self) -> None:
        log = self._page.folders.resolve(self._name.value)
        request = ReplayRequest(
            log=shorten_path(log),
            robot=self._page.request.robot,
            **self._form.read(),
        )
        request.check()
        self._saving.check()
        self._opening.ask(request)

    def _cancel(self) -> None:
        self._opening.cancel()
        self._saving.cancel()

    # Result -----------------------------------------------------------------------------------

    def _show(self, request: ReplayRequest, flight: ReplayedFlight) -> None:
        check_body(flight, self._page.world)
        self._page.timeline.load(make_take(flight, self._page.world), play=False)
        self._table.content = write_table(flight.report)
        is_own = flight.record.robot == request.robot
        self._opened = replace(request, robot=None) if is_own else request
        self._page.say(f"Opened {request.log}.")
        self._write_command()

    def _write_command(self) -> None:
        """Show the line that does the same."""
        if self._opened is not None:
            request = replace(self._opened, out=self._find_folder())
            self._command.content = make_block(write_command("replay", request))

    def _find_folder(self) -> Path:
        """Return the folder for the files, each of which lies within the folders of the page."""
        return shorten_path(self._page.folders.resolve_folder(self._folder.value, REPLAY_FILES))

    def _save(self) -> None:
        if self._opened is None:
            raise BadInputError("no flight log is open, expected one: see Open")
        request = replace(self._opened, out=self._find_folder())
        request.check()
        self._opening.cancel()
        self._saving.ask(request)

    def _tell_saved(self, _: ReplayRequest, flight: ReplayedFlight) -> None:
        folder, names = flight.written[0].parent, ", ".join(path.name for path in flight.written)
        self._page.say(f"Saved in {folder}: {names}.")


def check_body(flight: ReplayedFlight, world: World) -> None:
    """Refuse the flight of another body than that on the page."""
    body, shown = flight.world.robot.body, world.robot.body
    if body != shown:
        raise BadInputError(
            f"flight log {flight.record.path}: it is of the body '{body}', expected '{shown}': "
            "choose the body at the top of the page"
        )


def make_take(flight: ReplayedFlight, world: World) -> Take:
    """Make a take of a flight in the world of the page: the measured robot, and its twin."""
    report, robot, own = flight.report, world.robot, flight.world.model
    return Take(
        name=flight.record.path.name,
        time=report.time,
        qpos=transfer_positions(robot, own, world.model, flight.measured.qpos),
        ghost=transfer_positions(robot, own, world.model, flight.twin.qpos),
        joint_torque=robot.transmission.torque_at_joint(np.nan_to_num(flight.torque)),
        plots=tuple(_make_plots(flight)),
        marks=tuple(sorted(_make_marks(flight), key=lambda mark: mark.time)),
        facts=tuple(_list_facts(flight, world)),
    )


def _make_plots(flight: ReplayedFlight) -> list[Plot]:
    report, state = flight.report, flight.record.state
    worst = {report.joint_names[joint]: joint for joint in report.ranking[:PLOTTED]}
    joints = {
        "|measured - twin| [rad]": np.abs(report.difference),
        "Torque by current [N·m]": flight.torque,
        "Speed [rad/s]": state["joint_vel"],
    }
    both = {"robot": flight.measured, "twin": flight.twin}
    difference, *others = (
        Plot(title=title, curves={name: values[:, joint] for name, joint in worst.items()})
        for title, values in joints.items()
    )
    return [
        replace(difference, limit=report.threshold),
        Plot(title="Tilt [deg]", curves={k: np.degrees(one.tilt) for k, one in both.items()}),
        Plot(title="Torso height [m]", curves={k: one.height for k, one in both.items()}),
        *others,
    ]


def _make_marks(flight: ReplayedFlight) -> list[Mark]:
    """Make a mark of each event and each cut command, and of the divergence."""
    begin = float(flight.record.time[0])
    marks = [
        Mark(time=event.time - begin, text=f"{event.kind}: {event.text}")
        for event in flight.record.events[:MOST_EVENTS]
    ]
    longest = sorted(flight.cuts, key=lambda cut: cut.begin - cut.end)[:MOST_CUTS]
    marks += [Mark(time=cut.begin, text=str(cut)) for cut in longest]
    if (first := flight.report.divergence) is not None:
        text = f"diverged: {first.part} differs by {first.difference:+.3f} rad"
        marks.append(Mark(time=first.time, text=text))
    return marks


def _list_facts(flight: ReplayedFlight, world: World) -> list[str]:
    record, report = flight.record, flight.report
    date = f"{record.started.removesuffix('+00:00').replace('T', ' ')} UTC"
    ended = [f"Ended: {event.text}" for event in record.events if event.kind == ENDED]
    facts = [*ended[-1:], report.headline, record.describe()]
    facts += [f"{_describe_limit(record)}; {START[flight.start]}; recorded {date}"]
    if flight.scene != world.scene.name:
        facts.append(
            f"recorded in the scene '{flight.scene}', shown in '{world.scene.name}': "
            "choose the scene at the top of the page"
        )
    left_out = len(record.events[MOST_EVENTS:]), len(flight.cuts[MOST_CUTS:])
    if any(left_out):
        facts.append(f"without marks: {left_out[0]} events, {left_out[1]} cut commands")
    if not report.is_exact:
        worst = (
            f"{report.joint_names[joint]} {report.maximum[joint]:.3f} ({report.rms[joint]:.4f})"
            for joint in report.ranking[:PLOTTED]
        )
        facts.append(f"largest (RMS) differences [rad]: {', '.join(worst)}")
    return facts


def _describe_limit(record: FlightRecord) -> str:
    """Describe the torque limit that the servos were sent while they had torque."""
    sent = record.sent["torque_limit"]
    largest = float(np.max(sent, initial=0.0, where=np.isfinite(sent)))
    by = record.about.get("limit_by")
    return f"torque limit up to {largest:.2f} N·m{f' by {by}' if by else ''}"


def write_table(report: ReplayReport) -> str:
    """Write the differences of all joints as markdown, the largest first."""
    rows = [
        (report.joint_names[joint], f"{report.maximum[joint]:.4f}", f"{report.rms[joint]:.4f}")
        for joint in report.ranking
    ]
    return make_table(("Joint", "Largest", "RMS"), rows)
