"""The control loop: measure, decide, guard, move."""

from __future__ import annotations

import gc
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from enum import Enum
from typing import Protocol

import numpy as np

from drivers.errors import DriverError
from drivers.interrupts import unsuspended
from drivers.real_time_class import in_real_time_class
from drivers.safety_guard import SafetyGuard
from drivers.safety_limits import ClipCounts
from drivers.state import Command, State
from robots.quaternion import Array

MOST_TIMINGS = 100_000  # newest cycles of a run that its timing summary is of


class Controller(Protocol):
    """Computes commands from measurements; never touches a backend."""

    @property
    def done(self) -> bool:
        """Return whether it has finished."""
        ...

    def reset(self, state: State) -> None:
        """Start from a measurement."""
        ...

    def step(self, state: State) -> Command:
        """Compute the command for a measurement."""
        ...


class Ending(Enum):
    """How a run ended."""

    DONE = "the controller had done its work"
    TIMEOUT = "the time was up"
    FAULT = "the guard or the hardware stopped it"
    INTERRUPTED = "it was interrupted"


@dataclass(frozen=True, kw_only=True)
class Timing:
    """Durations of a cycle's parts, in wall time [s]."""

    late: float
    """Delay after its deadline; 0 for a loop without deadlines."""
    read: float
    step: float
    write: float


@dataclass(frozen=True, kw_only=True)
class TimingSummary:
    """Delays and durations of a run's cycles."""

    late_median: float
    """Delay of a cycle after its deadline [s]."""
    late_p99: float
    """[s]"""
    late_max: float
    """[s]"""
    busy_median: float
    """Time to measure, decide and move in a cycle [s]."""
    busy_p99: float
    """[s]"""

    @classmethod
    def of(cls, timings: Array) -> TimingSummary:
        """Summarize late, read, step and write times of cycles [s], (cycles, 4)."""
        timings = timings if len(timings) else np.zeros((1, 4))
        late = np.percentile(timings[:, 0], (50, 99, 100)).tolist()
        busy = np.percentile(timings[:, 1:].sum(axis=1), (50, 99)).tolist()
        return cls(
            late_median=late[0],
            late_p99=late[1],
            late_max=late[2],
            busy_median=busy[0],
            busy_p99=busy[1],
        )


@dataclass(frozen=True)
class Guidance:
    """Quantities that a controller follows besides joint targets, such as style curves."""

    wanted: Array
    """Targets now, (k,)."""
    measured: Array
    """Measurements of the same quantities, (k,)."""


@dataclass(frozen=True)
class Cycle:
    """One turn of the loop."""

    state: State
    asked: Command
    """Command of the controller."""
    sent: Command
    """Command that reached the servos."""
    clips: ClipCounts
    """Cuts by the guard so far."""
    timing: Timing
    guidance: Guidance | None = None
    """What the controller follows besides its targets; ``None`` for nothing."""


@dataclass(frozen=True, kw_only=True)
class RunReport:
    """Result of a run."""

    ending: Ending
    reason: str
    """One line: why it ended."""
    cycles: int
    overruns: int
    """Cycles longer than the period; only counted in real time."""
    period: float
    """Control period [s]."""
    duration: float
    """From first to last measurement, on the backend's clock [s]."""
    clips: ClipCounts
    """Cuts by the guard since it was connected."""
    holds: int
    """Cycles since then in which the targets were held because a measurement was too old."""
    pace: TimingSummary


def run(
    controller: Controller,
    guard: SafetyGuard,
    *,
    max_time: float,
    realtime: bool = False,
    on_cycle: Callable[[Cycle], None] | None = None,
) -> RunReport:
    """Connect, run a controller until it ends, and switch torque off.

    The loop takes a guard, not a bare backend, so no command reaches a servo unguarded.

    Args:
        controller: Computes the commands.
        guard: Limits and sends them.
        max_time: Time after which to stop [s], on the backend's clock.
        realtime: Start each cycle at its own deadline in wall time. A backend that paces
            itself, or a twin that may run faster than real time, does not need it.
        on_cycle: Called with each cycle, to judge or record it.
    """
    with engaged(guard, realtime=realtime):
        return run_engaged(
            controller, guard, max_time=max_time, realtime=realtime, on_cycle=on_cycle
        )


@contextmanager
def engaged(guard: SafetyGuard, *, realtime: bool = False) -> Iterator[None]:
    """Connect for several runs, one after the other without a gap; switch torque off afterwards.

    In real time, objects that exist now are not garbage collected meanwhile. Ctrl-Z ends it like
    Ctrl-C.
    """
    if not isinstance(guard, SafetyGuard):
        raise TypeError(
            f"a robot moves through a SafetyGuard only, not through a {type(guard).__name__}"
        )
    with unsuspended(), guard, _uncollected() if realtime else nullcontext():
        yield


def run_engaged(
    controller: Controller,
    guard: SafetyGuard,
    *,
    max_time: float,
    realtime: bool = False,
    on_cycle: Callable[[Cycle], None] | None = None,
) -> RunReport:
    """Run a controller on a connected robot, as `run` does, and leave its torque as it is.

    The next command is due within the time of the servos' watchdog, a tenth of a second.
    """
    loop = _Loop(guard, realtime)
    ending, reason = Ending.INTERRUPTED, Ending.INTERRUPTED.value
    try:
        with prioritized(guard, realtime=realtime):
            ending, reason = loop.run(controller, max_time, on_cycle)
    except KeyboardInterrupt:
        pass  # the report says so
    except DriverError as error:
        ending, reason = Ending.FAULT, str(error)
    return RunReport(
        ending=ending,
        reason=reason,
        cycles=loop.cycles,
        overruns=loop.pacer.overruns if loop.pacer else 0,
        period=guard.period,
        duration=loop.duration,
        clips=guard.clips,
        holds=guard.holds,
        pace=TimingSummary.of(np.array(loop.timings, dtype=float).reshape(-1, 4)),
    )


@contextmanager
def prioritized(guard: SafetyGuard, *, realtime: bool) -> Iterator[None]:
    """Run a loop over a wire in the real-time class of the scheduler, if that is permitted.

    A twin stays where it is: its physics would leave others no time where it is too slow.
    """
    with in_real_time_class() if realtime and guard.has_wire else nullcontext():
        yield


@contextmanager
def _uncollected() -> Iterator[None]:
    """Exclude existing objects from garbage collection, which takes longer than a cycle."""
    gc.collect()
    gc.freeze()
    try:
        yield
    finally:
        gc.unfreeze()


class Pacer:
    """Starts cycles at absolute deadlines, so that small delays do not accumulate."""

    def __init__(
        self,
        period: float,
        clock: Callable[[], float] = time.perf_counter,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self.period = period
        self.overruns = 0
        self.late = 0.0
        """How long after its deadline the last cycle began [s]."""
        self._clock, self._sleep = clock, sleep
        self._deadline = clock() + period

    def wait(self) -> None:
        """Sleep until the next deadline; if it has passed, count an overrun and start over."""
        early = self._deadline - self._clock()
        if early >= 0.0:
            self._sleep(early)
        else:
            self.overruns += 1
        now = self._clock()
        self.late = max(now - self._deadline, 0.0)
        if early < 0.0:
            self._deadline = now
        self._deadline += self.period


FIRST_READS = 5  # at most: a reply lost right after a pause would repeat values from before it


class _Loop:
    """State of a run, kept after an exception."""

    def __init__(self, guard: SafetyGuard, realtime: bool) -> None:
        self.guard, self._realtime = guard, realtime
        self.pacer: Pacer | None = None
        self.cycles = 0
        self.duration = 0.0
        self.timings: deque[tuple[float, float, float, float]] = deque(maxlen=MOST_TIMINGS)

    def run(
        self, controller: Controller, max_time: float, on_cycle: Callable[[Cycle], None] | None
    ) -> tuple[Ending, str]:
        clock = time.perf_counter
        # Deadlines count from here: connecting took its own time.
        self.pacer = Pacer(self.guard.period) if self._realtime else None
        began = clock()
        state = self._begin()
        start = state.time
        controller.reset(state)
        while not controller.done:
            # A backend's clock is a sum of periods, which is rounded: compare at half of one.
            if self.duration > max_time - 0.5 * self.guard.period:
                return Ending.TIMEOUT, f"{max_time:g} s were up"
            measured = clock()
            asked = controller.step(state)
            decided = clock()
            sent = self.guard.write(asked)
            moved = clock()
            late = self.pacer.late if self.pacer else 0.0
            timing = (late, measured - began, decided - measured, moved - decided)
            self.timings.append(timing)
            self.cycles += 1
            if on_cycle:
                parts = Timing(late=late, read=timing[1], step=timing[2], write=timing[3])
                followed = getattr(controller, "guidance", None)
                on_cycle(Cycle(state, asked, sent, self.guard.clips, parts, followed))
            if self.guard.fault:
                return Ending.FAULT, str(self.guard.fault)
            if self.pacer:
                self.pacer.wait()
            began = clock()
            state = self.guard.read()
            self.duration = state.time - start
        if fault := self.guard.check_stop():  # it came after the last command
            return Ending.FAULT, str(fault)
        return Ending.DONE, Ending.DONE.value

    def _begin(self) -> State:
        """Measure for the first time; again if values are those from before a pause."""
        for _ in range(FIRST_READS - 1):
            state = self.guard.begin()
            if not self.guard.is_outdated(state):
                return state
        return self.guard.begin()
