"""The session of a command that moves a robot: guard, judge, flight log, stop key."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, nullcontext
from pathlib import Path
from typing import Any

from drivers import Cycle, GuardLimits, SafetyGuard
from drivers.flight_log.writer import FlightLog
from drivers.stop_key import StopKey
from humanoid_getup.cli.backends import BackendChoice
from humanoid_getup.cli.options.shared import RunOptions
from humanoid_getup.evaluation.judge import GroundTruthJudge
from humanoid_getup.execution.result import PhaseChange
from humanoid_getup.execution.rise_session import AttemptOptions, RiseSession
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.plan import Strategy
from robots import Posture, Robot

FLIGHT = "flight.mcap"


class Recorder:
    """Writes a flight log from the first cycle on, if one is requested."""

    def __init__(self, open_log: Callable[[], FlightLog] | None) -> None:
        """Record into a log that the first cycle opens; ``None`` for no log."""
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
            text = f"attempt {change.attempt}: {change.detail}"
            self.opened.event(self._time, change.phase.name.lower(), text)


@contextmanager
def recording(
    out: Path | None,
    robot: Robot,
    about: Mapping[str, str | float | int],
    start: Posture | None = None,
) -> Iterator[Recorder]:
    """Record into a folder while the block lasts.

    Args:
        out: Folder, created with the first cycle; ``None`` for no log.
        robot: Robot that is moved.
        about: Metadata of the log.
        start: Posture of the robot at the first cycle, if known.
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
        print(f"getup: the flight log is incomplete: {fault}", file=sys.stderr)


def stop_key(choice: BackendChoice, guard: SafetyGuard) -> StopKey | nullcontext[None]:
    """Let any key of the terminal stop a robot that moves in real time."""
    return StopKey(guard.stop) if choice.realtime else nullcontext()


@contextmanager
def open_session(
    command: RunOptions,
    world: World,
    choice: BackendChoice,
    strategy: Strategy,
    *,
    report: Callable[[str], None],
    about: Mapping[str, str] | None = None,
    start: Posture | None = None,
    **options: Any,
) -> Iterator[RiseSession]:
    """Open the session of a command: guard, judge, flight log and stop key.

    Args:
        command: Options of the command.
        world: Robot and scene.
        choice: Robot to move.
        strategy: Strategy that gets the robot up.
        report: Called with each phase.
        about: Further metadata of the flight log.
        start: Posture of the robot at the first cycle, if known.
        options: Further `AttemptOptions`.
    """
    simulation, limit = choice.simulation, command.torque_limit
    guard = SafetyGuard(choice.backend, GuardLimits.of(world.robot, limit))
    about = {"seed": command.seed, "scene": command.scene, "backend": command.backend} | (
        dict(about or {})
    )
    with recording(command.out, world.robot, about, start) as recorder, stop_key(choice, guard):

        def note(change: PhaseChange) -> None:
            report(change.phase.value)
            recorder.note(change)

        yield RiseSession(
            guard=guard,
            world=world,
            strategy=strategy,
            options=AttemptOptions(
                torque_limit=choice.limit_torque(limit), realtime=choice.realtime, **options
            ),
            make_judge=simulation and (lambda: GroundTruthJudge(simulation, limit)),
            services=choice.services,
            on_phase=note,
            on_cycle=recorder.log,
        )
