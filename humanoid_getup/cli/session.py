"""The flight log of a command: every cycle and every phase, beside its other files."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, nullcontext
from pathlib import Path

import numpy as np

from drivers import Cycle, GuardLimits, SafetyGuard
from drivers.flight_log.writer import FlightLog
from drivers.stop_key import StopKey
from humanoid_getup.cli.backends import BackendChoice
from humanoid_getup.cli.options import RunOptions
from humanoid_getup.evaluation.judge import GroundTruthJudge
from humanoid_getup.execution.attempt_manager import AttemptOptions
from humanoid_getup.execution.estimation import check_start
from humanoid_getup.execution.get_up import Rise, get_up
from humanoid_getup.execution.result import PhaseChange
from humanoid_getup.simulation.falls import Fall
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.plan import Strategy
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


WHERE_IT_LAY = "where the robot lay"


def stop_key(body: BackendChoice, guard: SafetyGuard) -> StopKey | nullcontext[None]:
    """Let any key of the terminal stop a robot that lives at the speed of life."""
    return StopKey(guard.stop) if body.realtime else nullcontext()


def try_to_rise(
    world: World,
    body: BackendChoice,
    plans: Strategy,
    start: Fall | None,
    options: RunOptions,
    rng: np.random.Generator,
    *,
    attempts: int,
    preflight: bool = True,
    tell: Callable[[str], None],
) -> Rise:
    """Get a robot up through the attempt manager, logging the flight.

    Args:
        world: Robot and scene.
        body: Robot to move.
        plans: Finds motions or policies.
        start: Where to lay a simulated robot; ``None`` for where it lies.
        options: What the command was told.
        rng: Source of the plans' chance.
        attempts: How often to try.
        preflight: False: play without asking; never on hardware.
        tell: Hears what is going on.
    """
    simulation, limit = body.simulation, options.torque_limit
    guard = SafetyGuard(body.backend, GuardLimits.of(world.robot, limit))
    if start is not None and body.place is not None:
        check_start(world, start.posture)
        body.place(start.posture)
    how = AttemptOptions(
        max_attempts=attempts,
        torque_limit=body.limit_torque(limit),
        preflight=preflight,
        realtime=body.realtime,
    )
    about = {"seed": options.seed, "scene": options.scene, "backend": options.backend}
    with recording(options.out, world.robot, about) as recorder, stop_key(body, guard):

        def hear(change: PhaseChange) -> None:
            tell(change.phase.value)
            recorder.note(change)

        return get_up(
            guard,
            world,
            plans,
            rng,
            how,
            judge=simulation and (lambda: GroundTruthJudge(simulation, limit)),
            start_class=start and start.start_class,
            services=body.services,
            report=hear,
            on_cycle=recorder.log,
        )
