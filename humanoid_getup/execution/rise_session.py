"""What getting up needs: a robot behind its guard, a strategy, options, and hooks to report."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from drivers import Cycle, GuardLimits, SafetyGuard, Twin
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
    def on_twin(
        cls, twin: Twin, world: World, strategy: Strategy, options: AttemptOptions | None = None
    ) -> RiseSession:
        """Let a twin get up, judged by ground truth.

        A torque limit by PWM needs a twin that was built with ``pwm_limited``.
        """
        options = options or AttemptOptions()
        limit = options.torque_limit.value
        return cls(
            guard=SafetyGuard(twin, GuardLimits.of(twin.robot, torque_limit=limit)),
            world=world,
            strategy=strategy,
            options=options,
            make_judge=lambda: GroundTruthJudge(twin.simulation, limit),
        )

    def judge(self) -> Judge:
        """Make the judge of the next run."""
        if self.make_judge is not None:
            return self.make_judge()
        return SensorJudge(self.world, self.guard.period, self.options.torque_limit.value)
