"""What getting up needs: a robot behind its guard, a strategy, options, and hooks to report."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from drivers import Backend, Cycle, GuardLimits, SafetyGuard, Twin
from drivers.twin.simulation import Simulation
from humanoid_getup.evaluation.judge import GroundTruthJudge, SensorJudge
from humanoid_getup.execution.recovery import Cooling, RebootsServos
from humanoid_getup.execution.result import PhaseChange
from humanoid_getup.playback.play import Judge
from humanoid_getup.strategies.plan import Strategy


@dataclass(frozen=True, kw_only=True)
class RiseSession:
    """A robot that is to get up, how, and how often it may try."""

    guard: SafetyGuard
    """Robot; it is connected for each phase, and its torque is off after each."""
    strategy: Strategy
    """Makes the plans; its world and torque limit are those of preflight and judges, too."""
    max_attempts: int = 3
    start_class: str | None = None
    """Side on which the robot lies, where that is known; None: as first measured."""
    settle: bool = True
    """False for a simulated robot that was placed at rest: it is measured at once."""
    preflight: bool = True
    """False: play without a preflight; never on hardware."""
    realtime: bool = False
    """Pace the cycles by the wall clock, for backends that do not pace themselves."""
    cooling: Cooling = field(default_factory=Cooling)
    simulation: Simulation | None = None
    """Ground truth for the judges; None for sensors alone."""
    services: RebootsServos | None = None
    """Reboots servos; None where the backend cannot."""
    on_phase: Callable[[PhaseChange], None] = lambda _: None
    """Called with every phase."""
    on_cycle: Callable[[Cycle], None] | None = None
    """Called with every cycle of the runs, to record it."""

    def __post_init__(self) -> None:
        if self.max_attempts < 1:
            raise ValueError(f"max_attempts is {self.max_attempts}, expected 1 or more")

    @classmethod
    def on(cls, backend: Backend, strategy: Strategy, **options: Any) -> RiseSession:
        """Let the robot of a backend get up; ``options`` are further fields of the session.

        A backend without a guard is put behind one with the strategy's torque limit. A twin
        limits torque in the mode of the strategy and is judged by ground truth; other backends
        reboot servos if they can.

        Raises:
            ValueError: if the backend limits torque in another mode.
        """
        limit, guard = strategy.torque_limit, backend
        if not isinstance(guard, SafetyGuard):
            guard = SafetyGuard(backend, GuardLimits.of(backend.robot, limit.value))
        body = guard.backend
        if isinstance(body, Twin):
            body.limit_by = limit.mode
            options["simulation"] = body.simulation
        elif isinstance(body, RebootsServos):
            options["services"] = body
        if body.limit_by != limit.mode:
            raise ValueError(
                f"the backend limits torque by '{body.limit_by}', expected '{limit.mode}' as the "
                "strategy: build both with one mode"
            )
        return cls(guard=guard, strategy=strategy, **options)

    def make_judge(self) -> Judge:
        """Make the judge of the next run."""
        limit = self.strategy.torque_limit.value
        if self.simulation is not None:
            return GroundTruthJudge(self.simulation, limit)
        return SensorJudge(self.strategy.world, self.guard.period, limit)
