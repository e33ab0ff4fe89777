"""The flight log of a job that moves a robot."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from typing import Any

from drivers import Cycle
from drivers.flight_log.writer import FlightLog, make_room
from humanoid_getup.commands.get_up.options import MoveOptions
from humanoid_getup.execution.session import PhaseChange
from robots import Posture, Robot

FLIGHT = "flight.mcap"


class FlightRecorder:
    """Writes a flight log from the first cycle on, if one is requested."""

    def __init__(self, log: FlightLog | None, closing: ExitStack) -> None:
        """Record into a log that the first cycle opens and ``closing`` closes; None for no log."""
        self._log, self._closing = log, closing
        self._time = 0.0
        self._notes: list[PhaseChange] = []

    def log(self, cycle: Cycle) -> None:
        """Record a cycle."""
        self._time = cycle.state.time
        if self._log is None:
            return
        if not self._log.cycles:
            self._log.path.parent.mkdir(parents=True, exist_ok=True)
            self._closing.enter_context(self._log)
            for change in self._notes:
                self._write(self._log, change)
        self._log.log(cycle)

    def note(self, change: PhaseChange) -> None:
        """Record a phase that begins, at the time of the last cycle."""
        if self._log is not None and self._log.cycles:
            self._write(self._log, change)
        else:
            self._notes.append(change)

    def _write(self, log: FlightLog, change: PhaseChange) -> None:
        text = f"attempt {change.attempt}: {change.detail}"
        log.event(self._time, change.phase.name.lower(), text)


def make_log(
    request: MoveOptions, robot: Robot, start: Posture | None = None, **about: Any
) -> FlightLog | None:
    """Make the flight log of a request; ``None`` for one without a folder.

    ``start`` is the posture of a simulated robot at rest; the facts of ``about`` are stored in the
    log.
    """
    if request.out is None:
        return None
    about |= {
        "body": str(robot.body),
        "load": robot.load,
        "seed": request.seed,
        "scene": request.scene,
        "backend": request.backend,
        "limit_by": request.limit_by or robot.limit_by,
    }
    return FlightLog(request.out / FLIGHT, robot, about=about, start=start)


@contextmanager
def recording(log: FlightLog | None, tell: Callable[[str], None]) -> Iterator[FlightRecorder]:
    """Record while the block lasts, and tell of an incomplete log; ``None`` for no log.

    An earlier log of that name is renamed even if nothing is recorded.
    """
    with ExitStack() as closing:
        yield FlightRecorder(log, closing)
    if log is not None and not log.cycles:
        make_room(log.path)  # of an earlier run: it is not of this one
    if log is not None and log.fault:
        tell(f"the flight log is incomplete: {log.fault}")
