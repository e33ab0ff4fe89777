"""Plays a motion, or any controller, through the safety guard, and judges the run."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol, TypeVar

import numpy as np

from drivers import (
    Command,
    Cycle,
    Ending,
    RunReport,
    SafetyGuard,
    State,
    engaged,
    run_engaged,
)
from drivers.control_loop import Controller
from humanoid_getup.experiments.judging.lying import LYING_TIME
from humanoid_getup.experiments.judging.outcome import JointFigures, Outcome
from humanoid_getup.experiments.judging.standing import HOLD
from humanoid_getup.motions.motion import NO_END, Motion
from humanoid_getup.playback.balance import Balance
from robots import Robot
from robots.quaternion import Array

LYING_HOLD = LYING_TIME + 0.5  # s; a robot may move on for a moment before it lies still


def hold_time(motion: Motion) -> float:
    """Return how long the end of a motion is held for judging [s]."""
    if motion.end_class == NO_END:
        return 0.0
    return HOLD if motion.rises else LYING_HOLD


class TimedController(Controller, Protocol):
    """A controller that ends by itself."""

    @property
    def longest(self) -> float:
        """Return its longest duration [s], without the approach to its start."""
        ...


APPROACH_SPEED = 1.5  # rad/s, to the first target


class MotionPlayer:
    """Plays a motion's servo targets, then holds the last for a while.

    A robot whose joints are elsewhere first approaches the motion's first targets, all joints
    together and no faster than ``APPROACH_SPEED``.
    """

    def __init__(
        self,
        robot: Robot,
        motion: Motion,
        *,
        hold: float,
        torque_limit: float | None = None,
        held: Array | None = None,
        balance: Balance | None = None,
    ) -> None:
        """Prepare to play a motion, and to ``hold`` its end for a while [s].

        ``held`` are the targets that the servos follow already [rad], (n,); ``None`` if torque is
        off, and begins where the joints are. ``balance`` corrects the targets; without it they
        are sent as they are.
        """
        self._robot, self._motion, self._torque_limit = robot, motion, torque_limit
        self.longest = motion.duration + hold
        """Time that motion and hold take [s]."""
        self.approach_time = 0.0
        """Time that the approach to the first targets takes [s]."""
        self._begin = self._clock = 0.0
        self._held, self._balance = held, balance
        self._from = motion.joint_target[0]

    @property
    def done(self) -> bool:
        """Return whether the motion and the hold are over."""
        return self._is_over(self.longest)

    def reset(self, state: State) -> None:
        """Begin at the held targets, or at the measured joint angles."""
        self._begin = self._clock = state.time
        self._from = state.joint_pos if self._held is None else self._held
        self.approach_time = find_approach_time(self._robot, self._motion, self._from)
        if self._balance is not None:
            self._balance.reset(self._from)

    def _is_over(self, duration: float) -> bool:
        """Return whether a time [s] has passed since the end of the approach."""
        return self._clock - self._begin >= self.approach_time + duration - 1e-9

    def step(self, state: State) -> Command:
        """Send the targets that are due at the measurement."""
        self._clock = state.time
        time = self._clock - self._begin - self.approach_time
        target = self._target(time)
        if self._balance is not None:
            target = self._balance.correct(state, time, target)
        return Command.position(self._robot, target, self._torque_limit)

    def _target(self, time: float) -> Array:
        first = self._motion.joint_target[0]
        if time < 0.0:  # the approach ends at 0
            return first + (time / self.approach_time) * (first - self._from)
        return self._motion.sample(self._motion.time[0] + time)


def find_approach_time(robot: Robot, motion: Motion, joint_pos: Array) -> float:
    """Compute the time of the approach to a motion's first targets [s] from angles [rad], (n,)."""
    distance = np.abs(motion.joint_target[0] - joint_pos)
    reach = robot.max_velocity * robot.control_period  # in one cycle
    return 0.0 if np.all(distance <= reach) else float(distance.max()) / APPROACH_SPEED


GRACE = 5.0  # s beyond the controller's longest: the approach to a motion's start


Outcome_co = TypeVar("Outcome_co", bound=Outcome | JointFigures, covariant=True)


class Judge(Protocol[Outcome_co]):
    """Judges one run."""

    def __call__(self, cycle: Cycle, /) -> None:
        """Observe a cycle."""
        ...

    def end(self) -> bool | None:
        """Stop observing; return at once whether the run ended in a held stand.

        ``None`` if that cannot be known.
        """
        ...

    def conclude(self) -> Outcome_co:
        """Judge the run; that may take longer than a cycle."""
        ...


AnyJudge = Judge[Outcome | JointFigures]


def play(
    controller: TimedController,
    guard: SafetyGuard,
    judge: Judge[Outcome_co],
    *,
    realtime: bool = False,
    on_cycle: Callable[[Cycle], None] | None = None,
) -> tuple[RunReport, Outcome_co]:
    """Run a controller to its end and judge the run; torque is off afterwards.

    The guard is closed before and after, the judge is that of this run alone, and ``realtime``
    paces the cycles by the wall clock.

    Raises:
        KeyboardInterrupt: if the run was interrupted.
    """
    with engaged(guard, realtime=realtime):
        report = play_engaged(controller, guard, judge, realtime=realtime, on_cycle=on_cycle)
    return report, judge.conclude()


def play_engaged(
    controller: TimedController,
    guard: SafetyGuard,
    judge: AnyJudge,
    *,
    realtime: bool = False,
    on_cycle: Callable[[Cycle], None] | None = None,
) -> RunReport:
    """Run a controller to its end on a connected robot, as `play` does; its torque stays on.

    The judge observes, and may conclude once torque is off.

    Raises:
        KeyboardInterrupt: if the run was interrupted.
    """

    def observe(cycle: Cycle) -> None:
        judge(cycle)
        if on_cycle is not None:
            on_cycle(cycle)

    report = run_engaged(
        controller,
        guard,
        max_time=controller.longest + GRACE,
        realtime=realtime,
        on_cycle=observe,
    )
    if report.ending is Ending.INTERRUPTED:
        judge.end()
        raise KeyboardInterrupt
    return report
