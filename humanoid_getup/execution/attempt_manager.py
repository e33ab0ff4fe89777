"""The attempt manager: plays rises, judges and recovers, until the robot stands or needs help."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from drivers import DriverError, Ending, FaultKind, State
from drivers.control_loop import Pacer
from humanoid_getup.execution.phase import Phase, PhaseChange
from humanoid_getup.execution.recovery import Recovery, StoppedError, UnrecoveredError
from humanoid_getup.execution.result import Attempt, AttemptStatus, RiseResult
from humanoid_getup.execution.rise_session import RiseSession
from humanoid_getup.execution.stand_keeper import StandKeeper
from humanoid_getup.playback.estimation import FaultedError, StartError, estimate_posture, settle
from humanoid_getup.playback.play import play_engaged
from humanoid_getup.playback.preflight import Verdict
from humanoid_getup.playback.supervisor import Supervisor
from humanoid_getup.simulation.falls import UNCLASSED, classify
from humanoid_getup.strategies.plan import RisePlan
from robots import Posture

MOST_REMEDIES = 5  # faults of a robot at rest after which it is not recovered again


class AttemptManager:
    """Gets a robot up, on any backend.

    Each attempt waits, torque off, until the robot is still, classifies how it lies, plans,
    runs the preflight, plays under supervision and judges. After a failed attempt the robot
    rests until every servo is cool; then the next one begins, up to a maximum. After that, or at
    a fault that rest does not clear, the robot needs help. A stop ends everything at once:
    nothing moves until the guard is cleared and a new rise is started. A robot that stands is
    kept standing, lies down, goes limp or is handed over, as the session says.
    """

    def __init__(self, session: RiseSession) -> None:
        self._session, self._guard = session, session.guard
        self._keeper = StandKeeper(session.stand)
        self._number = 1
        self._recovery = Recovery(
            session.guard,
            cooling=session.cooling,
            services=session.services,
            realtime=session.realtime,
            report=lambda text: self._report(Phase.RECOVERING, text),
        )

    def get_up(self, rng: np.random.Generator) -> RiseResult:
        """Try until the robot stands, is stopped, or needs help; ``rng`` is for the plans.

        Raises:
            KeyboardInterrupt: if it was interrupted; the robot's torque is off then.
        """
        attempts: list[Attempt] = []
        by_fault = False
        try:
            status, reason = self._try_all(attempts, rng)
        except StoppedError as stop:
            status, reason = AttemptStatus.STOPPED, f"{AttemptStatus.STOPPED.value}: {stop}"
        except (UnrecoveredError, DriverError) as error:
            status, reason, by_fault = AttemptStatus.NEEDS_HELP, str(error), True
        self._report(Phase.ENDED, reason)
        measured = next((a.start_class for a in attempts if a.start_class), UNCLASSED)
        return RiseResult(
            robot=self._guard.robot,
            start_class=self._session.start_class or measured,
            status=status,
            reason=reason,
            attempts=tuple(attempts),
            by_fault=by_fault or _ended_by_fault(attempts, status),
        )

    def _try_all(
        self, attempts: list[Attempt], rng: np.random.Generator
    ) -> tuple[AttemptStatus, str]:
        most = self._session.max_attempts
        for self._number in range(1, most + 1):
            attempt = self._attempt(rng)
            attempts.append(attempt)
            if attempt.stood:
                return AttemptStatus.STOOD, attempt.reason
            self._check_end(attempt)
            if attempt.plan is not None and _is_plan_to_blame(attempt):
                attempt.plan.forget()
            if self._number < most:
                self._recover(attempt)
        if most == 1:
            return AttemptStatus.NEEDS_HELP, attempts[0].reason
        reasons = "; ".join(f"{a.number}. {a.reason}" for a in attempts)
        return AttemptStatus.NEEDS_HELP, f"{most} attempts failed: {reasons}"

    def _attempt(self, rng: np.random.Generator) -> Attempt:
        session = self._session
        try:
            state = self._settle()
        except StartError as error:
            return Attempt(number=self._number, refusal=str(error))
        posture = self._estimate(state)
        side = classify(posture.orientation) or UNCLASSED
        self._report(Phase.PLANNING, f"the robot lies {side}")
        plan = session.strategy.plan(posture, rng)
        if not session.balance:
            plan = plan.open_loop() or plan
        attempt = Attempt(number=self._number, start_class=side, plan=plan)
        controller = plan.controller(session.strategy)
        if controller is None:
            return attempt
        if session.preflight:
            self._report(Phase.PREFLIGHT, plan.title)
            plan, verdict = self._preflight(plan, state)
            attempt = replace(attempt, plan=plan, verdict=verdict)
            controller = plan.controller(session.strategy)
            if controller is None or not verdict.passed:
                return replace(attempt, refusal=str(verdict))
            down = self._keeper.preflight(state)
            if not down.passed:
                return replace(attempt, refusal=f"the way down after the stand: {down}")
        self._report(Phase.PLAYING, plan.title)
        return self._play(attempt, controller)

    def _preflight(self, plan: RisePlan, state: State) -> tuple[RisePlan, Verdict]:
        """Judge a plan, and without its feedback if it falls with it; return which is played."""
        strategy = self._session.strategy
        verdict = plan.preflight(strategy, state, self._locate)
        other = plan.open_loop() if verdict.falls else None
        if other is not None:
            second = other.preflight(strategy, state, self._locate)
            if second.passed:
                return other, second
        return plan, verdict

    def _settle(self) -> State:
        """Wait until the robot is still, and recover from faults meanwhile."""
        for _ in range(MOST_REMEDIES):
            self._report(Phase.SETTLING, Phase.SETTLING.value)
            if not self._session.settle:
                return self._measure()
            pacer = Pacer(self._guard.period) if self._session.realtime else None
            try:
                return settle(self._guard, pacer)
            except FaultedError as error:
                fault = error.fault
            self._recovery.remedy(fault)
        raise UnrecoveredError(f"{fault}, {MOST_REMEDIES} times in a row")

    def _locate(self) -> Posture:
        """Measure the robot's posture again."""
        return self._estimate(self._measure())

    def _estimate(self, state: State) -> Posture:
        world, locate = self._session.strategy.world, self._session.locate
        return estimate_posture(world, state, locate() if locate else None)

    def _measure(self) -> State:
        with self._guard:
            return self._guard.read()

    def _play(self, attempt: Attempt, controller: Supervisor) -> Attempt:
        judge, after = self._session.make_judge(), None
        with self._keeper.engaged():
            report = play_engaged(
                controller,
                self._guard,
                judge,
                realtime=self._session.realtime,
                on_cycle=self._keeper.watch,
            )
            completed = report.ending is Ending.DONE and controller.aborted is None
            if judge.end() and completed:
                may_balance = attempt.plan is None or attempt.plan.may_balance
                may_balance &= self._session.balance
                after = self._keeper.keep(balanced=may_balance)
        return replace(
            attempt,
            run=report,
            outcome=judge.conclude(),
            abort=controller.aborted,
            warnings=tuple(controller.warnings),
            after=after,
        )

    def _check_end(self, attempt: Attempt) -> None:
        """Raise if the operator stopped the robot or its connection was lost."""
        if attempt.run is None or attempt.run.ending is not Ending.FAULT:
            return
        fault = self._guard.fault
        if fault is None:
            raise UnrecoveredError(attempt.run.reason)
        if fault.kind is FaultKind.STOPPED:
            raise StoppedError(fault.detail)

    def _recover(self, attempt: Attempt) -> None:
        """Rest after a failed attempt, and clear the fault that ended its run."""
        fault = self._guard.fault
        if attempt.run is not None and attempt.run.ending is Ending.FAULT and fault is not None:
            self._recovery.remedy(fault)
        self._recovery.cool_down()

    def _report(self, phase: Phase, detail: str) -> None:
        self._session.on_phase(PhaseChange(phase, self._number, detail))


def _is_plan_to_blame(attempt: Attempt) -> bool:
    """Return whether a plan would fail again: it fell, in the preflight or when it was played."""
    if attempt.run is not None:
        return attempt.run.ending is not Ending.FAULT
    return attempt.verdict is not None and attempt.verdict.falls


def _ended_by_fault(attempts: list[Attempt], status: AttemptStatus) -> bool:
    """Return whether a fault of the guard or the hardware ended the last attempt."""
    if status is not AttemptStatus.NEEDS_HELP or not attempts:
        return False
    last = attempts[-1].run
    return last is not None and last.ending is Ending.FAULT
