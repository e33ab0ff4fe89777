"""The result of getting up: how it ended, every attempt, and its figures."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from enum import Enum
from functools import partial
from typing import Literal

import msgspec
from msgspec import UNSET, UnsetType
from msgspec.structs import asdict

from drivers import Ending, RunReport
from drivers.errors import UnreleasedError
from humanoid_getup.execution.after_stand import AfterFigures, AfterStand, HandOver
from humanoid_getup.experiments.judging.outcome import JointFigures, Outcome
from humanoid_getup.experiments.judging.standing import HOLD_TIME
from humanoid_getup.motions.preference import PreferenceName
from humanoid_getup.playback.monitors import Abort
from humanoid_getup.playback.preflight import Verdict
from humanoid_getup.strategies.plan import KeyFigures, Plan, RiseStatus
from humanoid_getup.style.followed_style import StyleFigures
from robots import Robot


class AttemptStatus(Enum):
    """Final status of getting up."""

    STOOD = "the robot stands"
    PLAYED = "played; without an IMU it is unknown whether it stands"
    NEEDS_HELP = "the robot needs help"
    STOPPED = "stopped by the operator"


@dataclass(frozen=True, kw_only=True)
class PlayedMove:
    """A move to a place with room to rise, as played."""

    plan: Plan
    outcome: Outcome


@dataclass(frozen=True, kw_only=True)
class Attempt:
    """One attempt to get up, as far as it went."""

    number: int
    """From 1."""
    start_class: str | None = None
    """Class of its start; None if it did not come to rest."""
    plan: Plan | None = None
    verdict: Verdict | None = None
    """Verdict of the preflight."""
    run: RunReport | None = None
    """None if nothing was played."""
    outcome: Outcome | None = None
    joint_figures: JointFigures | None = None
    """What the joints of a robot without an IMU measured, in place of an outcome."""
    abort: Abort | None = None
    """Reason of the supervisor's abort, if any."""
    warnings: tuple[str, ...] = ()
    refusal: str | None = None
    """Why it was not played."""
    after: AfterStand | None = None
    """What followed its stand; None without one."""
    release: UnreleasedError | None = None
    """The joints that did not confirm that their torque is off; None if all did."""
    moves: tuple[PlayedMove, ...] = ()
    """Moves that were played before."""
    refused: tuple[Plan, ...] = ()
    """Plans that the preflight refused and that were made again."""

    @property
    def plans(self) -> tuple[Plan, ...]:
        """Return all plans that were made, the last one last."""
        moves = (move.plan for move in self.moves)
        return (*moves, *self.refused, *([self.plan] if self.plan else []))

    @property
    def stood(self) -> bool:
        """Return whether it ended in a held stand."""
        if self.run is None or self.outcome is None or self.abort is not None:
            return False
        return self.run.ending is Ending.DONE and bool(self.outcome.stood)

    @property
    def is_unknown(self) -> bool:
        """Return whether its end is unknown: it was played by a robot without an IMU."""
        if self.run is None or self.joint_figures is None:
            return False
        return self.run.ending is Ending.DONE and self.abort is None

    @property
    def reason(self) -> str:
        """Return in one line how it ended, and why."""
        if self.run is None:
            return self.refusal or (self.plan.reason if self.plan else "not started")
        if self.stood:
            return "held stand"
        if self.abort is not None:
            return f"aborted after {self.abort.time:.1f} s: {self.abort}"
        if self.run.ending is not Ending.DONE:
            return self.run.reason
        if self.outcome is None:
            hold = self.after and self.after.hold
            failed = "" if not hold or hold.ran else f"; holding it ended: {hold.reason}"
            return AttemptStatus.PLAYED.value + failed
        return f"held no stand: {self.outcome.stand.hold_time:.1f} s of {HOLD_TIME:.1f} s"


class RolloutFigures(msgspec.Struct, frozen=True, kw_only=True):
    """A planned rise in its own rollout."""

    stand_time_s: float
    peak_torque_nm: float
    peak_braking_torque_nm: float
    rms_torque_nm: float
    neck_delta_v_m_s: float | None
    self_overlap_m: float | None


@dataclass(frozen=True, kw_only=True)
class RiseFigures(StyleFigures):
    """The figures of a rise, under report.json's keys; None if it did not get that far."""

    planned: bool
    stood: bool | None
    stand_time_s: float | None = None
    plan_s: float
    filter_s: float
    torque_use: float | None = None
    peak_torque_nm: float | None = None
    rms_torque_nm: float | None = None
    head_impact_m_s: float | None = None
    self_collisions: int | None = None
    ground_penetrations: int | None = None
    limit_violations: int | None = None
    clips: int
    rollouts: int
    rounds: int
    robust: float | None
    connection: str | None
    strategy: str | None
    policy: str | None
    style: str | None
    balanced: bool | None
    keys: list[KeyFigures]
    prefer: PreferenceName | None
    search_budget_s: float | None
    searched_s: float | None
    rollout: RolloutFigures | None
    rollout_before_improvement: RolloutFigures | None
    start_class: str | None
    reason: str
    hold_s: float | None
    moves: int
    moves_s: float
    moves_peak_torque_nm: float | None
    moves_head_impact_m_s: float | None
    refused_plans: int
    attempts: int
    period_s: float | None
    overruns: int
    late_p99_s: float | None
    busy_p99_s: float | None
    holds: int
    clips_by_joint: list[str]
    attempt_reasons: list[str]
    warnings: list[str]
    after: AfterFigures | None
    judged_by: Literal["sensors", "truth"] | None
    peak_braking_torque_nm: float | None = None
    peak_velocity_rad_s: float | None = None
    neck_delta_v_m_s: float | None = None
    detour_rad: float | None = None
    height_lost: float | None = None
    jerk_rad_s3: float | None = None
    played: bool | UnsetType = UNSET
    """Whether it was played to its end; this and the fields below only without an IMU."""
    without_imu: bool | UnsetType = UNSET
    held_s: float | UnsetType = UNSET


@dataclass(frozen=True, kw_only=True)
class Rise:
    """How getting up ended. Plan, run and outcome are those of the last attempt."""

    robot: Robot
    start_class: str
    status: AttemptStatus
    reason: str
    """One line; for a robot that needs help, what was observed."""
    by_fault: bool = False
    """Whether a hardware fault ended it, not a failed rise."""
    attempts: tuple[Attempt, ...] = ()
    has_imu: bool = True
    """False for a robot that cannot measure its orientation."""
    unreleased: tuple[str, ...] = ()
    """Joints that did not confirm that their torque is off."""

    def __str__(self) -> str:
        """Describe in one line how it ended, by which motion, and how it was judged."""
        outcome, tries = self.outcome, len(self.attempts)
        name = f"{self.robot.name}, {self.start_class}"
        if not self.stood or outcome is None:
            return f"{name}: does not stand: {self.reason}"
        moves = sum(len(attempt.moves) for attempt in self.attempts)
        moved = f" after {moves} move{'s' if moves > 1 else ''}" if moves else ""
        judged = "by sensors alone" if outcome.is_sensed else "by the simulation"
        return (
            f"{name}: stands after {outcome.stand.start_time:.2f} s, "
            f"held {outcome.stand.hold_time:.2f} s ({self.plan.title}{moved}, attempt {tries}, "
            f"judged {judged})"
        )

    @property
    def stood(self) -> bool:
        """Return whether the robot ended in a held stand."""
        return self.status is AttemptStatus.STOOD

    @property
    def plan(self) -> Plan:
        """Return the last plan."""
        plan = self.attempts[-1].plan if self.attempts else None
        return plan or Plan(status=RiseStatus.NOT_PLANNED)

    @property
    def run(self) -> RunReport | None:
        """Return the last run, if something was played in it."""
        return self.attempts[-1].run if self.attempts else None

    @property
    def outcome(self) -> Outcome | None:
        """Return the outcome of the last run."""
        return self.attempts[-1].outcome if self.attempts else None

    @property
    def moves(self) -> tuple[PlayedMove, ...]:
        """Return the moves that were played before the last run."""
        return self.attempts[-1].moves if self.attempts else ()

    @property
    def after(self) -> AfterStand | None:
        """Return what followed the stand, if the robot stood."""
        return self.attempts[-1].after if self.attempts else None

    @property
    def hand_over(self) -> HandOver | None:
        """Return the state in which the robot was handed over, if it was."""
        return self.after and self.after.hand_over

    @property
    def times_played(self) -> int:
        """Return the number of attempts in which something was played."""
        return sum(attempt.run is not None for attempt in self.attempts)

    def figures(self) -> RiseFigures:
        """Return the figures of the rise."""
        run, outcome, attempts, plan = self.run, self.outcome, self.attempts, self.plan
        plans = attempts[-1].plans if attempts else ()
        moves = [move.outcome for attempt in attempts for move in attempt.moves]
        impacts = [float(o.head_impact) for o in moves if o.head_impact is not None]
        joined = plan.connection and plan.connection.motion
        settings, policy = plan.settings, plan.policy
        make = partial(
            RiseFigures,
            **(vars(policy.followed.figures()) if policy and policy.followed else {}),
            planned=plan.planned,
            plan_s=sum(plan.plan_s for plan in plans),
            filter_s=sum(plan.filter_s for plan in plans),
            rollouts=plan.rollouts,
            rounds=plan.rounds,
            robust=None if math.isnan(plan.robust) else plan.robust,
            connection=joined and joined.name,
            strategy=joined and joined.strategy,
            policy=plan.policy_name or None,
            style=policy and policy.style and policy.style.name,
            balanced=plan.is_balanced if plan.motion else None,
            keys=[key.figures for key in plan.keys],
            prefer=settings and settings.prefer,
            search_budget_s=settings and settings.search_budget,
            searched_s=settings and plan.searched,
            rollout=plan.rollout and plan.rollout.figures(RolloutFigures),
            rollout_before_improvement=plan.before and plan.before.figures(RolloutFigures),
            start_class=self.start_class,
            stood=self.stood,
            reason=self.reason,
            hold_s=float(outcome.stand.hold_time) if outcome else 0.0,
            moves=len(moves),
            moves_s=sum(int(o.record.cycles) for o in moves) * self.robot.control_period,
            moves_peak_torque_nm=max((float(o.peak_torque) for o in moves), default=None),
            moves_head_impact_m_s=max(impacts, default=None),
            refused_plans=sum(len(attempt.refused) for attempt in attempts),
            attempts=self.times_played,
            period_s=run.period if run else None,
            overruns=run.overruns if run else 0,
            late_p99_s=run.pace.late_p99 if run else None,
            busy_p99_s=run.pace.busy_p99 if run else None,
            holds=run.holds if run else 0,
            clips=run.clips.total if run else 0,
            clips_by_joint=run.clips.describe(self.robot) if run else [],
            attempt_reasons=[attempt.reason for attempt in attempts],
            warnings=[text for attempt in attempts for text in attempt.warnings],
            after=self.after and self.after.figures(),
            judged_by=outcome and ("sensors" if outcome.is_sensed else "truth"),
        )
        figures = outcome.figures(make) if outcome else make()
        if not self.stood:
            figures = replace(figures, stand_time_s=None)
        return figures if self.has_imu else self._add_joints(figures)

    def _add_joints(self, figures: RiseFigures) -> RiseFigures:
        """Add the figures of joints; None for those that are unknown without an IMU."""
        last = self.attempts[-1] if self.attempts else Attempt(number=1)
        hold = self.after and self.after.hold
        verdict = last.verdict.warnings if last.verdict else ()
        return replace(
            figures,
            stood=None,
            hold_s=None,
            start_class=None,
            played=last.is_unknown,
            without_imu=True,
            balanced=False,
            held_s=hold.run.duration if hold else 0.0,
            warnings=[*map(str, verdict), *last.warnings],
            after=None,
            **(asdict(last.joint_figures) if last.joint_figures else {}),
        )
