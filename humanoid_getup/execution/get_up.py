"""The main job: measure a fallen robot, plan its rise, play it, judge the stand."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from drivers import Cycle, Ending, GuardLimits, RunReport, SafetyGuard, Twin, run
from humanoid_getup.evaluation.judge import GroundTruthJudge, RunOutcome
from humanoid_getup.evaluation.standing import HOLD, HOLD_TIME
from humanoid_getup.execution.attempt_manager import (
    UNCLASSED,
    AttemptManager,
    AttemptOptions,
    Judge,
)
from humanoid_getup.execution.estimation import check_start
from humanoid_getup.execution.motion_player import MotionPlayer
from humanoid_getup.execution.recovery import RebootsServos
from humanoid_getup.execution.result import AttemptResult, AttemptStatus, PhaseChange
from humanoid_getup.motions.motion import Motion
from humanoid_getup.simulation.falls import Fall
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.learned_rise import PolicyPlan
from humanoid_getup.strategies.plan import RisePlan, RiseStatus, Strategy
from humanoid_getup.strategies.planned_rise import PlannedRise
from robots import Posture, Robot
from robots.quaternion import Array


@dataclass(frozen=True, kw_only=True)
class Rise:
    """How one rise went, from the lying posture to the judged stand.

    Where it took several attempts, plan, run and what was watched are the last one's.
    """

    robot: Robot
    start_class: str
    plan: RisePlan
    run: RunReport | None
    """None when there was nothing to play."""
    outcome: RunOutcome | None
    result: AttemptResult | None = None
    """Every attempt; None for a motion that was played outside the attempt manager."""

    @property
    def stood(self) -> bool:
        """Tell whether the robot ended in a held stand."""
        if self.result is not None:
            return self.result.status is AttemptStatus.STOOD
        finished = self.run is not None and self.run.ending is Ending.DONE
        return finished and self.outcome is not None and self.outcome.stand.stood

    @property
    def reason(self) -> str:
        """Return in one line why the rise ended as it did."""
        if self.result is not None:
            return self.result.reason
        if self.run is None or self.outcome is None:
            return self.plan.reason
        if self.stood:
            return "held stand"
        if self.run.ending is not Ending.DONE:
            return self.run.reason
        return f"fell: held {self.outcome.stand.hold_time:.1f} s, needed {HOLD_TIME:.1f} s"

    @property
    def attempts(self) -> int:
        """Return how many times something was played."""
        if self.result is None:
            return 1 if self.run else 0
        return sum(attempt.run is not None for attempt in self.result.attempts)

    def record(self) -> dict[str, Any]:
        """Return the figures of the rise under report.json's keys."""
        outcome, plan = self.outcome, self.plan
        connection = plan.connection
        record: dict[str, Any] = {
            "start_class": self.start_class,
            "planned": plan.planned,
            "stood": self.stood,
            "reason": self.reason,
            "stand_time_s": outcome.stand.start_time if outcome and self.stood else None,
            "hold_s": outcome.stand.hold_time if outcome else 0.0,
            "plan_s": plan.plan_s,
            "filter_s": plan.filter_s,
            "rehearsals": plan.rehearsals,
            "rehearsal_rounds": plan.rounds,
            "robust": None if math.isnan(plan.robust) else plan.robust,
            "connection": connection.motion.name if connection else None,
            "strategy": connection.motion.strategy if connection else None,
            "policy": plan.name if isinstance(plan, PolicyPlan) else None,
            "attempts": self.attempts,
            "period_s": self.run.period if self.run else None,
            "overruns": self.run.overruns if self.run else 0,
            "late_p99_s": self.run.pace.late_p99 if self.run else None,
            "busy_p99_s": self.run.pace.busy_p99 if self.run else None,
            "holds": self.run.holds if self.run else 0,
            "clips": self.run.clips.total if self.run else 0,
            "clips_by_joint": self.run.clips.describe(self.robot) if self.run else [],
        }
        if self.result is not None:
            tried = self.result.attempts
            record["attempt_reasons"] = [attempt.reason for attempt in tried]
            record["warnings"] = [text for attempt in tried for text in attempt.warnings]
        if outcome:
            record |= {
                "judged_by": "sensors" if outcome.is_sensed else "truth",
                "peak_torque_nm": outcome.peak_torque,
                "peak_velocity_rad_s": outcome.peak_velocity,
                "torque_use": outcome.torque_use,
                "rms_torque_nm": outcome.rms_torque,
                "self_collisions": outcome.self_collisions,
                "ground_penetrations": outcome.ground_penetrations,
                "limit_violations": outcome.limit_violations,
                "head_impact_m_s": outcome.head_impact,
            }
        return record


def rise(
    twin: Twin,
    planner: PlannedRise,
    start: Posture,
    start_class: str,
    rng: np.random.Generator,
    *,
    realtime: bool = False,
    max_attempts: int = 1,
    report: Callable[[PhaseChange], None] = lambda _: None,
    on_cycle: Callable[[Cycle], None] | None = None,
) -> Rise:
    """Get a twin up from a posture: settle, measure, plan, play, judge.

    Raises:
        StartError: if the start reaches into the ground.
        KeyboardInterrupt: once the robot is limp, if somebody interrupted.
    """
    options = AttemptOptions(
        max_attempts=max_attempts,
        torque_limit=planner.options.torque_limit,
        # Without the filter, what is asked for is to see the raw path fail or stand.
        preflight=planner.options.filtering,
        realtime=realtime,
    )
    fall = Fall(posture=start, start_class=start_class)
    return lay_down_and_get_up(
        twin, planner.world, planner, fall, rng, options, report=report, on_cycle=on_cycle
    )


def lay_down_and_get_up(
    twin: Twin,
    world: World,
    plans: Strategy,
    fall: Fall,
    rng: np.random.Generator,
    options: AttemptOptions,
    *,
    temperature: Array | None = None,
    report: Callable[[PhaseChange], None] = lambda _: None,
    on_cycle: Callable[[Cycle], None] | None = None,
) -> Rise:
    """Put a twin where it fell, and get it up.

    Args:
        twin: Robot.
        world: Robot and scene that plans and preflight work with.
        plans: Finds what to play.
        fall: How it lies.
        rng: Source of the plans' chance.
        options: How to try, and how often.
        temperature: How warm its servos are at first [°C], (n,); ``None`` for cool.
        report: Hears of every phase.
        on_cycle: Sees every cycle.

    Raises:
        StartError: if the start reaches into the ground.
        KeyboardInterrupt: once the robot is limp, if somebody interrupted.
    """
    check_start(world, fall.posture)
    limit = options.torque_limit.value
    guard = SafetyGuard(twin, GuardLimits.of(twin.robot, torque_limit=limit))
    twin.place(fall.posture)
    if temperature is not None:
        twin.simulation.temperature[:] = temperature
    return get_up(
        guard,
        world,
        plans,
        rng,
        options,
        judge=lambda: GroundTruthJudge(twin.simulation, limit),
        start_class=fall.start_class,
        report=report,
        on_cycle=on_cycle,
    )


def get_up(
    guard: SafetyGuard,
    world: World,
    plans: Strategy,
    rng: np.random.Generator,
    options: AttemptOptions,
    *,
    judge: Callable[[], Judge] | None = None,
    start_class: str | None = None,
    services: RebootsServos | None = None,
    report: Callable[[PhaseChange], None] = lambda _: None,
    on_cycle: Callable[[Cycle], None] | None = None,
) -> Rise:
    """Get a robot up from where it lies, on any backend.

    Args:
        guard: Robot.
        world: Robot and scene that plans and preflight work with.
        plans: Finds motions.
        rng: Source of the plans' chance.
        options: How to try, and how often.
        judge: Makes the judge of one run; ``None`` for sensors alone.
        start_class: Side on which it lies, where that is known; else as first measured.
        services: Reboots servos, where the backend can.
        report: Hears of every phase.
        on_cycle: Sees every cycle of the runs, to record it.

    Raises:
        KeyboardInterrupt: once the robot is limp, if somebody interrupted.
    """
    manager = AttemptManager(
        guard,
        world,
        plans,
        options,
        judge=judge,
        services=services,
        report=report,
        on_cycle=on_cycle,
    )
    result = manager.get_up(rng)
    last = result.attempts[-1] if result.attempts else None
    measured = next((a.start_class for a in result.attempts if a.start_class), UNCLASSED)
    return Rise(
        robot=guard.robot,
        start_class=start_class or measured,
        plan=(last and last.plan) or RisePlan(status=RiseStatus.NOT_PLANNED, reason=result.reason),
        run=last and last.run,
        outcome=last and last.outcome,
        result=result,
    )


def play(
    guard: SafetyGuard,
    judge: Judge,
    motion: Motion,
    torque_limit: float | None,
    *,
    realtime: bool = False,
    on_cycle: Callable[[Cycle], None] = lambda _: None,
) -> tuple[RunReport, RunOutcome]:
    """Play a motion on a simulated robot through loop and guard and watch how it ends.

    Raises:
        KeyboardInterrupt: once the robot is limp, if somebody interrupted.
    """
    player = MotionPlayer(guard.robot, motion, hold=HOLD, torque_limit=torque_limit)

    def look(cycle: Cycle) -> None:
        judge(cycle)
        on_cycle(cycle)

    longest = motion.duration + HOLD + 5.0
    report = run(player, guard, max_time=longest, realtime=realtime, on_cycle=look)
    if report.ending is Ending.INTERRUPTED:
        raise KeyboardInterrupt
    return report, judge.conclude()
