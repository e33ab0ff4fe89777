"""What getting up needs: a robot behind its guard, a strategy, options, and hooks to report."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from drivers import Backend, Cycle, GuardLimits, SafetyGuard, Twin
from humanoid_getup.evaluation.judge import GroundTruthJudge, SensorJudge
from humanoid_getup.execution.recovery import Cooling, RebootsServos
from humanoid_getup.execution.result import PhaseChange
from humanoid_getup.playback.monitors import MonitorLimits
from humanoid_getup.playback.play import Judge
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.plan import Strategy
from robots import FULL_TORQUE, TorqueLimit


@dataclass(frozen=True, kw_only=True)
class AttemptOptions:
    """How to try to get up, and how often."""

    max_attempts: int = 3
    torque_limit: TorqueLimit = FULL_TORQUE
    settle: bool = True
    """False for a simulated robot that was placed at rest: it is measured at once."""
    preflight: bool = True
    """False: play without a preflight; never on hardware."""
    realtime: bool = False
    """Pace the cycles by the wall clock, for backends that do not pace themselves."""
    monitor_limits: MonitorLimits = field(default_factory=MonitorLimits)
    cooling: Cooling = field(default_factory=Cooling)

    def __post_init__(self) -> None:
        if self.max_attempts < 1:
            raise ValueError(f"max_attempts is {self.max_attempts}, expected 1 or more")


@dataclass(frozen=True, kw_only=True)
class RiseSession:
    """A robot that is to get up, and how."""

    guard: SafetyGuard
    """Robot; it is connected for each phase, and its torque is off after each."""
    world: World
    """Robot and scene that plans and preflight work with."""
    strategy: Strategy
    options: AttemptOptions = field(default_factory=AttemptOptions)
    make_judge: Callable[[], Judge] | None = None
    """Makes the judge of one run; None for sensors alone."""
    services: RebootsServos | None = None
    """Reboots servos; None where the backend cannot."""
    on_phase: Callable[[PhaseChange], None] = lambda _: None
    """Called with every phase."""
    on_cycle: Callable[[Cycle], None] | None = None
    """Called with every cycle of the runs, to record it."""

    @classmethod
    def on(
        cls,
        backend: Backend,
        world: World,
        strategy: Strategy,
        options: AttemptOptions | None = None,
        **hooks: Any,
    ) -> RiseSession:
        """Let the robot of a backend get up.

        A twin limits torque as the options say, by PWM or not, and is judged by ground truth,
        every other backend by its sensors.

        Args:
            backend: Robot; it is put behind a guard with the torque limit if it has none.
            world: Robot and scene that plans and preflight work with.
            strategy: Finds a way to get up.
            options: How to try, and how often.
            hooks: Further fields of the session.
        """
        options = options or AttemptOptions()
        limit = options.torque_limit.value
        guard = backend
        if not isinstance(guard, SafetyGuard):
            guard = SafetyGuard(backend, GuardLimits.of(backend.robot, torque_limit=limit))
        body = guard.backend
        if isinstance(body, Twin):
            body.pwm_limited = options.torque_limit.by_pwm
            hooks["make_judge"] = lambda: GroundTruthJudge(body.simulation, limit)
        elif isinstance(body, RebootsServos):
            hooks["services"] = body
        return cls(guard=guard, world=world, strategy=strategy, options=options, **hooks)

    def judge(self) -> Judge:
        """Make the judge of the next run."""
        if self.make_judge is not None:
            return self.make_judge()
        return SensorJudge(self.world, self.guard.period, self.options.torque_limit.value)
