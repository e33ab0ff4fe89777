"""The attempt manager: try to get up, look how it went, and know when to ask for help."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np

from drivers import Cycle, DriverError, Ending, FaultKind, SafetyGuard, State, run
from drivers.control_loop import Controller, Pacer
from humanoid_getup.evaluation.judge import RunOutcome, SensorJudge
from humanoid_getup.execution.estimation import FaultedError, StartError, estimate_posture, settle
from humanoid_getup.execution.monitors import Abort, MonitorLimits
from humanoid_getup.execution.preflight import check_body, preflight
from humanoid_getup.execution.recovery import (
    Cooling,
    RebootsServos,
    Recovery,
    StoppedError,
    UnrecoveredError,
)
from humanoid_getup.execution.result import (
    Attempt,
    AttemptResult,
    AttemptStatus,
    Phase,
    PhaseChange,
)
from humanoid_getup.execution.supervisor import PolicySupervisor, Supervisor
from humanoid_getup.simulation.falls import classify
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.learned_rise import PolicyPlan
from humanoid_getup.strategies.plan import RisePlan, RiseStatus, Strategy
from robots import FULL_TORQUE, TorqueLimit

UNCLASSED = "other"  # start class of a robot that lies on no side
MOST_REMEDIES = 5  # faults of a robot that only lies there, before it is left alone
GRACE = 5.0  # s that a run may take beyond its longest: the way to a motion's start


class Judge(Protocol):
    """Sees each cycle of one run and says how it ended."""

    def __call__(self, cycle: Cycle, /) -> None:
        """Look once."""
        ...

    def conclude(self) -> RunOutcome:
        """Judge what was seen."""
        ...


class Supervised(Controller, Protocol):
    """Moves a robot and gives up when the rise goes wrong."""

    @property
    def longest(self) -> float:
        """Return how long it takes at most [s], but for the way to its start."""
        ...

    @property
    def aborted(self) -> Abort | None:
        """Return why it gave up, if it did."""
        ...

    @property
    def warnings(self) -> list[str]:
        """Return what was odd but no reason to stop."""
        ...


@dataclass(frozen=True, kw_only=True)
class AttemptOptions:
    """How to try, and how often."""

    max_attempts: int = 3
    torque_limit: TorqueLimit = FULL_TORQUE
    preflight: bool = True
    """False: play without asking; never on hardware."""
    realtime: bool = False
    """Pace the cycles by the wall clock, for backends that do not pace themselves."""
    supervision: MonitorLimits = field(default_factory=MonitorLimits)
    cooling: Cooling = field(default_factory=Cooling)

    def __post_init__(self) -> None:
        if self.max_attempts < 1:
            raise ValueError(f"max_attempts is {self.max_attempts}, allowed 1 or more")


class AttemptManager:
    """Gets a robot up, on any backend.

    Each attempt waits, limp, until the robot is still, classes how it lies, plans, asks the
    preflight, plays under supervision and judges. A failed one is followed by rest, until
    every servo is cool, and by another, up to a number of them; then, or when it meets what
    no rest cures, it asks for help. A stop ends it at once: nothing moves any more until
    somebody clears the guard and asks anew.
    """

    def __init__(
        self,
        guard: SafetyGuard,
        world: World,
        plans: Strategy,
        options: AttemptOptions | None = None,
        *,
        judge: Callable[[], Judge] | None = None,
        services: RebootsServos | None = None,
        report: Callable[[PhaseChange], None] = lambda _: None,
        on_cycle: Callable[[Cycle], None] | None = None,
    ) -> None:
        """Prepare.

        Args:
            guard: Robot to get up; it is connected for each phase and limp after it.
            world: Robot and scene that plans and preflight work with.
            plans: Finds motions or policies: a `PlannedRise`, `NearestMotion`, `LearnedRise`...
            options: How to try, and how often.
            judge: Makes the judge of one run; ``None`` for sensors alone.
            services: Reboots servos, where the backend can.
            report: Hears of every phase.
            on_cycle: Sees every cycle of the runs, to record it.
        """
        self._guard, self._stage, self._plans = guard, world, plans
        self.options = options = options or AttemptOptions()
        self._judge = judge or self._judge_by_sensors
        self._report, self._on_cycle = report, on_cycle
        self._number = 1
        self._recovery = Recovery(
            guard,
            cooling=options.cooling,
            services=services,
            realtime=options.realtime,
            tell=lambda text: self._tell(Phase.RECOVERING, text),
        )

    def get_up(self, rng: np.random.Generator) -> AttemptResult:
        """Try until the robot stands, is stopped, or needs help.

        Args:
            rng: Source of the plans' chance.

        Raises:
            KeyboardInterrupt: once the robot is limp, if somebody interrupted.
        """
        attempts: list[Attempt] = []
        by_fault = False
        try:
            status, reason = self._try_all(attempts, rng)
        except StoppedError as stop:
            status, reason = AttemptStatus.STOPPED, f"{AttemptStatus.STOPPED.value}: {stop}"
        except (UnrecoveredError, DriverError) as error:
            status, reason, by_fault = AttemptStatus.NEEDS_HELP, str(error), True
        self._tell(Phase.ENDED, reason)
        return AttemptResult(
            status=status,
            reason=reason,
            attempts=tuple(attempts),
            by_fault=by_fault or _ended_by_fault(attempts, status),
        )

    def _try_all(
        self, attempts: list[Attempt], rng: np.random.Generator
    ) -> tuple[AttemptStatus, str]:
        most = self.options.max_attempts
        for self._number in range(1, most + 1):
            attempt = self._attempt(rng)
            attempts.append(attempt)
            if attempt.stood:
                return AttemptStatus.STOOD, attempt.reason
            self._check_end(attempt)
            if self._number < most:
                self._recover(attempt)
        if most == 1:
            return AttemptStatus.NEEDS_HELP, attempts[0].reason
        told = "; ".join(f"{a.number}. {a.reason}" for a in attempts)
        return AttemptStatus.NEEDS_HELP, f"{most} attempts failed: {told}"

    def _attempt(self, rng: np.random.Generator) -> Attempt:
        number = self._number
        try:
            state = self._settle()
        except StartError as error:
            return Attempt(number=number, refusal=str(error))
        posture = estimate_posture(self._stage, state)
        kind = classify(posture.orientation) or UNCLASSED
        self._tell(Phase.PLANNING, f"the robot lies {kind}")
        plan = self._plans.plan(posture, rng)
        attempt = Attempt(number=number, start_class=kind, plan=plan)
        supervisor = self._supervise(plan)
        if supervisor is None:
            return attempt
        if self.options.preflight:
            self._tell(Phase.PREFLIGHT, plan.title)
            attempt = self._check(attempt, plan, state)
            if attempt.refusal is not None:
                return attempt
        self._tell(Phase.PLAYING, plan.title)
        return self._play(attempt, supervisor)

    def _settle(self) -> State:
        """Wait until the robot is still, and put right what keeps it from being watched."""
        for _ in range(MOST_REMEDIES):
            self._tell(Phase.SETTLING, Phase.SETTLING.value)
            pacer = Pacer(self._guard.period) if self.options.realtime else None
            try:
                return settle(self._guard, pacer)
            except FaultedError as error:
                fault = error.fault
            self._recovery.remedy(fault)
        raise UnrecoveredError(f"{fault}, {MOST_REMEDIES} times in a row")

    def _check(self, attempt: Attempt, plan: RisePlan, settled: State) -> Attempt:
        """Ask the preflight, from where the robot lies now: planning took its time.

        Supply and temperatures are those of the robot that lay still: a bus reads them in
        turns, so a first measurement need not have them all. Nobody knows how a policy will
        move, so no more than these is asked for it.
        """
        if plan.motion is None:
            reasons = check_body(self._stage.robot, settled.voltage, settled.temperature)
            told = "; ".join(map(str, reasons))
            return replace(attempt, refusal=f"preflight refused: {told}" if told else None)
        with self._guard:
            now = self._guard.read()
        verdict = preflight(
            self._stage,
            plan.motion,
            voltage=settled.voltage,
            torque_limit=self.options.torque_limit,
            temperature=settled.temperature,
            start=now,
        )
        return replace(attempt, verdict=verdict, refusal=None if verdict.passed else str(verdict))

    def _supervise(self, plan: RisePlan) -> Supervised | None:
        """Make what plays a plan, watched; None where it holds nothing to play."""
        supervision, limit = self.options.supervision, self.options.torque_limit.value
        if isinstance(plan, PolicyPlan):
            return PolicySupervisor(plan.policy, supervision)
        if plan.motion is None:
            return None
        supervision = replace(
            supervision,
            tracks_motion=supervision.tracks_motion and _went_through_physics(plan),
        )
        return Supervisor(self._stage, plan.motion, torque_limit=limit, supervision=supervision)

    def _play(self, attempt: Attempt, supervisor: Supervised) -> Attempt:
        judge = self._judge()

        def look(cycle: Cycle) -> None:
            judge(cycle)
            if self._on_cycle:
                self._on_cycle(cycle)

        report = run(
            supervisor,
            self._guard,
            max_time=supervisor.longest + GRACE,
            realtime=self.options.realtime,
            on_cycle=look,
        )
        if report.ending is Ending.INTERRUPTED:
            raise KeyboardInterrupt
        return replace(
            attempt,
            run=report,
            outcome=judge.conclude(),
            abort=supervisor.aborted,
            warnings=tuple(supervisor.warnings),
        )

    def _check_end(self, attempt: Attempt) -> None:
        """Let nothing follow a stop or a robot that was lost."""
        if attempt.run is None or attempt.run.ending is not Ending.FAULT:
            return
        fault = self._guard.fault
        if fault is None:
            raise UnrecoveredError(attempt.run.reason)
        if fault.kind is FaultKind.STOPPED:
            raise StoppedError(fault.detail)

    def _recover(self, attempt: Attempt) -> None:
        """Rest after a failed attempt, and put right what its run ended by."""
        fault = self._guard.fault
        if attempt.run is not None and attempt.run.ending is Ending.FAULT and fault is not None:
            self._recovery.remedy(fault)
        self._recovery.cool_down()

    def _judge_by_sensors(self) -> Judge:
        return SensorJudge(self._stage, self._guard.period, self.options.torque_limit.value)

    def _tell(self, phase: Phase, detail: str) -> None:
        self._report(PhaseChange(phase, self._number, detail))


def _went_through_physics(plan: RisePlan) -> bool:
    """Tell whether the motion's angles were measured: in a rehearsal, or when it was stored."""
    return plan.status is not RiseStatus.UNREHEARSED or plan.connection is None


def _ended_by_fault(attempts: list[Attempt], status: AttemptStatus) -> bool:
    """Tell whether the last attempt was cut off by the guard or the hardware."""
    if status is not AttemptStatus.NEEDS_HELP or not attempts:
        return False
    last = attempts[-1].run
    return last is not None and last.ending is Ending.FAULT
