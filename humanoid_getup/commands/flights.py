"""The flight log of a command: every cycle and every phase, beside its other files."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path

from drivers import Cycle
from drivers.flight_log import FlightLog
from humanoid_getup.attempt_result import PhaseChange
from robots import Posture, Robot

FLIGHT = "flight.mcap"


class Recorder:
    """Writes a flight log from the first cycle on, or nothing where none was asked for."""

    def __init__(self, open_log: Callable[[], FlightLog] | None) -> None:
        """Record into a log that is opened when there is something to record."""
        self._open_log = open_log
        self.opened: FlightLog | None = None
        self._time = 0.0
        self._notes: list[PhaseChange] = []

    def log(self, cycle: Cycle) -> None:
        """Record a cycle."""
        self._time = cycle.state.time
        if self.opened is None and self._open_log is not None:
            self.opened = self._open_log()
            for change in self._notes:
                self.note(change)
        if self.opened is not None:
            self.opened.log(cycle)

    def note(self, change: PhaseChange) -> None:
        """Record a phase that begins, at the time of the last cycle."""
        if self.opened is None:
            self._notes.append(change)
        else:
            told = f"attempt {change.attempt}: {change.detail}"
            self.opened.event(self._time, change.phase.name.lower(), told)


@contextmanager
def recording(
    out: Path | None,
    robot: Robot,
    about: Mapping[str, str | float | int],
    start: Posture | None = None,
) -> Iterator[Recorder]:
    """Record into a folder while the block lasts, or nowhere.

    Args:
        out: Folder, made if need be; ``None`` for nowhere.
        robot: Robot that is moved.
        about: What the log is about.
        start: Where the robot is when the first cycle begins, if that is known.
    """
    if out is None:
        yield Recorder(None)
        return
    with ExitStack() as closing:

        def open_log() -> FlightLog:
            out.mkdir(parents=True, exist_ok=True)
            log = FlightLog(out / FLIGHT, robot, about=about, start=start)
            return closing.enter_context(log)

        recorder = Recorder(open_log)
        yield recorder
        fault = recorder.opened.fault if recorder.opened else None
    if fault:
        print(f"getup: the flight log is not whole: {fault}", file=sys.stderr)
