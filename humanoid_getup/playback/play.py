"""Plays a motion, or any controller, through the safety guard, and judges the run."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from drivers import (
    Command,
    Cycle,
    Ending,
    Guidance,
    RunReport,
    SafetyGuard,
    State,
    engaged,
    run_engaged,
)
from drivers.control_loop import Controller
from drivers.twin.simulation import Simulation
from humanoid_getup.experiments.judging.judge import GroundTruthJudge
from humanoid_getup.experiments.judging.lying import LYING_TIME, MAX_HEAD_IMPACT, measure_lying
from humanoid_getup.experiments.judging.outcome import JointFigures, Outcome
from humanoid_getup.experiments.judging.standing import HOLD, HOLD_TIME
from humanoid_getup.motions.motion import NO_END, STANDING, Motion
from humanoid_getup.playback.balance import Balance
from humanoid_getup.scenes.scene import Scene
from robots import Robot
from robots.quaternion import Array

REST = LYING_TIME + 0.5  # s; a robot may move on for a moment before it lies still


def hold_time(motion: Motion) -> float:
    """Return how long the end of a motion is held for judging [s]."""
    if motion.end_class == NO_END:
        return 0.0
    return HOLD if motion.rises else REST


def has_succeeded(motion: Motion, outcome: Outcome) -> NDArray[np.bool_]:
    """Return whether runs of a motion ended in a held stand, or lying softly on its side, (...).

    A path has no intended end, so it always succeeds.
    """
    if motion.end_class == STANDING:
        return outcome.stood
    if motion.end_class == NO_END:
        return np.ones_like(outcome.record.diverged)
    lies = measure_lying(outcome.record, motion.end_class).lies
    impact = outcome.head_impact
    return lies if impact is None else lies & (impact <= MAX_HEAD_IMPACT)


def describe_end(motion: Motion) -> str:
    """Describe the intended end of a motion."""
    if motion.end_class == NO_END:
        return "anywhere"
    return "in a held stand" if motion.rises else f"lying {motion.end_class}, softly and still"


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
        if time < 0.0:
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


def play_in_simulation(
    controller: TimedController,
    guard: SafetyGuard,
    simulation: Simulation,
    scene: Scene,
    *,
    torque_limit: float | None = None,
    on_cycle: Callable[[Cycle], None] | None = None,
    stop_early: bool = False,
) -> tuple[RunReport, Outcome]:
    """Play a controller as `play` does, and judge it by the ground truth of the simulation.

    That is the simulation behind the guard; torques are judged under a limit [N·m]. With
    ``stop_early`` the run ends once the robot stands steadily, which counts as a held stand.
    """
    judge = GroundTruthJudge(simulation, torque_limit, scene)
    if not stop_early:
        return play(controller, guard, judge, on_cycle=on_cycle)
    steady = SteadyStand(simulation, lambda: judge.is_upright)
    until_known = UntilSteady(controller, steady)

    def observe(cycle: Cycle) -> None:
        steady.observe()
        if on_cycle is not None:
            on_cycle(cycle)

    report, outcome = play(until_known, guard, judge, on_cycle=observe)
    return report, outcome.settle() if steady.is_reached else outcome


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


# A robot that has stood without a break for this time, and hardly moves at its end, stands.
STEADY_TIME = 1.0  # s
STEADY_SPEED = 0.1  # rad/s and m/s, of every degree of freedom


class SteadyStand:
    """Observes whether a robot has stood for a while, and hardly moves.

    Of 64 rises of OP3's styled policy, from four sides in four styles, on flat ground and on three
    medium rough ones, all 34 that came to a steady stand ended in a held one, and no other did.
    """

    def __init__(self, simulation: Simulation, is_upright: Callable[[], bool]) -> None:
        """Begin; ``is_upright`` returns whether the standing condition holds."""
        self._simulation, self._is_upright = simulation, is_upright
        self._cycles = 0  # in a row in which it stands
        self.is_reached = False
        """Whether the robot stands steadily."""

    def observe(self) -> None:
        """Observe the robot at the end of a control period."""
        self._cycles = self._cycles + 1 if self._is_upright() else 0
        held = (self._cycles - 1) * self._simulation.period
        is_slow = float(np.abs(self._simulation.data.qvel).max()) < STEADY_SPEED
        self.is_reached = held >= HOLD_TIME or (held >= STEADY_TIME and is_slow)


class UntilSteady:
    """Runs a controller until it is done, or the robot stands steadily."""

    def __init__(self, controller: TimedController, stand: SteadyStand) -> None:
        self._controller, self._stand = controller, stand
        self.longest = controller.longest
        """Longest duration of the run [s]."""

    @property
    def done(self) -> bool:
        """Return whether the run is over."""
        return self._stand.is_reached or self._controller.done

    @property
    def guidance(self) -> Guidance | None:
        """Return the quantities that the controller follows besides its targets."""
        return getattr(self._controller, "guidance", None)

    def reset(self, state: State) -> None:
        """Begin at a measurement."""
        self._controller.reset(state)

    def step(self, state: State) -> Command:
        """Return the controller's command."""
        return self._controller.step(state)
