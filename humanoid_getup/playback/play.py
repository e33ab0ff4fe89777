"""Plays a controller on a robot through the safety guard, and judges how that ends."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from drivers import Cycle, Ending, RunReport, SafetyGuard, run
from drivers.control_loop import Controller
from humanoid_getup.evaluation.judge import RunOutcome

GRACE = 5.0  # s that a run may take beyond its controller's longest: the way to a motion's start


class TimedController(Controller, Protocol):
    """A controller that ends by itself."""

    @property
    def longest(self) -> float:
        """Return the time it takes at most [s], without the approach to its start."""
        ...


class Judge(Protocol):
    """Observes each cycle of one run and judges how it ended."""

    def __call__(self, cycle: Cycle, /) -> None:
        """Observe one cycle."""
        ...

    def conclude(self) -> RunOutcome:
        """Judge the run."""
        ...


def play(
    controller: TimedController,
    guard: SafetyGuard,
    judge: Judge,
    *,
    realtime: bool = False,
    on_cycle: Callable[[Cycle], None] | None = None,
) -> tuple[RunReport, RunOutcome]:
    """Run a controller to its end and judge the run; torque is off afterwards.

    Args:
        controller: Moves the robot.
        guard: Robot, closed before and after.
        judge: Observes this run.
        realtime: Pace the cycles by the wall clock, for backends that do not pace themselves.
        on_cycle: Called with every cycle.

    Raises:
        KeyboardInterrupt: if the run was interrupted.
    """

    def observe(cycle: Cycle) -> None:
        judge(cycle)
        if on_cycle is not None:
            on_cycle(cycle)

    report = run(
        controller,
        guard,
        max_time=controller.longest + GRACE,
        realtime=realtime,
        on_cycle=observe,
    )
    if report.ending is Ending.INTERRUPTED:
        raise KeyboardInterrupt
    return report, judge.conclude()
