"""The one control loop: measure, decide, guard, move."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import Protocol

from drivers.errors import DriverError
from drivers.guard import SafetyGuard
from drivers.guard_limits import ClipCounts
from drivers.state import Command, State


class Controller(Protocol):
    """Decides what the robot does next; never touches a backend."""

    @property
    def done(self) -> bool:
        """Tell whether there is nothing more to do."""
        ...

    def reset(self, state: State) -> None:
        """Begin anew from a measurement."""
        ...

    def step(self, state: State) -> Command:
        """Answer a measurement with a command."""
        ...


class Ending(Enum):
    """How a run ended."""

    DONE = "the controller had done its work"
    TIMEOUT = "the time was up"
    FAULT = "the guard or the hardware stopped it"
    INTERRUPTED = "somebody interrupted it"


@dataclass(frozen=True)
class Cycle:
    """One turn of the loop."""

    state: State
    asked: Command
    """What the controller wanted."""
    sent: Command
    """What reached the servos."""


@dataclass(frozen=True, kw_only=True)
class RunReport:
    """How a run went."""

    ending: Ending
    reason: str
    """One line: why it ended."""
    cycles: int
    overruns: int
    """Cycles that took longer than the period; only counted in real time."""
    period: float
    """Control period [s]."""
    duration: float
    """From first to last measurement, on the backend's clock [s]."""
    clips: ClipCounts
    """What the guard cut."""


def run(
    controller: Controller,
    guard: SafetyGuard,
    *,
    max_time: float,
    realtime: bool = False,
    on_cycle: Callable[[Cycle], None] | None = None,
) -> RunReport:
    """Connect, let a controller move a robot until it ends, and leave the robot limp.

    The loop takes a guard, not a bare backend, so no command reaches a servo unguarded.

    Args:
        controller: Decides.
        guard: Protects and moves.
        max_time: Time after which to stop [s], on the backend's clock.
        realtime: Start each cycle on its own deadline of the wall clock. A backend that
            paces itself, or a twin that may run faster than life, does not need it.
        on_cycle: Sees each cycle, to judge or record it.
    """
    if not isinstance(guard, SafetyGuard):
        raise TypeError(
            f"run() moves a robot through a SafetyGuard only, not a {type(guard).__name__}"
        )
    loop = _Loop(guard, Pacer(guard.period) if realtime else None)
    ending, reason = Ending.INTERRUPTED, Ending.INTERRUPTED.value
    with guard:
        try:
            ending, reason = loop.turn(controller, max_time, on_cycle)
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
    )


class Pacer:
    """Starts cycles on absolute deadlines, so that small delays do not add up."""

    def __init__(
        self,
        period: float,
        clock: Callable[[], float] = time.perf_counter,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self.period = period
        self.overruns = 0
        self._clock, self._sleep = clock, sleep
        self._deadline = clock() + period

    def wait(self) -> None:
        """Sleep until the next deadline; when it has passed, count it and start anew."""
        early = self._deadline - self._clock()
        if early >= 0.0:
            self._sleep(early)
        else:
            self.overruns += 1
            self._deadline -= early
        self._deadline += self.period


class _Loop:
    """The state of a run, kept when an exception ends it."""

    def __init__(self, guard: SafetyGuard, pacer: Pacer | None) -> None:
        self.guard, self.pacer = guard, pacer
        self.cycles = 0
        self.duration = 0.0

    def turn(
        self,
        controller: Controller,
        max_time: float,
        on_cycle: Callable[[Cycle], None] | None,
    ) -> tuple[Ending, str]:
        state = self.guard.read()
        start = state.time
        controller.reset(state)
        while not controller.done:
            # A backend's clock adds up periods: half of one decides, not the last bit.
            if self.duration > max_time - 0.5 * self.guard.period:
                return Ending.TIMEOUT, f"{max_time:g} s were up"
            asked = controller.step(state)
            sent = self.guard.write(asked)
            self.cycles += 1
            if on_cycle:
                on_cycle(Cycle(state, asked, sent))
            if self.guard.fault:
                return Ending.FAULT, str(self.guard.fault)
            if self.pacer:
                self.pacer.wait()
            state = self.guard.read()
            self.duration = state.time - start
        return Ending.DONE, Ending.DONE.value
