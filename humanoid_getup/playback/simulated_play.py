"""Plays in simulation: judged by ground truth, ended early, and by the end a motion has."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from drivers import (
    Command,
    Cycle,
    Guidance,
    RunReport,
    SafetyGuard,
    State,
)
from drivers.twin.simulation import Simulation
from humanoid_getup.experiments.judging.judge import GroundTruthJudge
from humanoid_getup.experiments.judging.lying import MAX_HEAD_IMPACT, measure_lying
from humanoid_getup.experiments.judging.outcome import Outcome
from humanoid_getup.experiments.judging.standing import HOLD_TIME
from humanoid_getup.motions.motion import NO_END, STANDING, Motion
from humanoid_getup.playback.play import TimedController, play
from humanoid_getup.scenes.scene import Scene


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
