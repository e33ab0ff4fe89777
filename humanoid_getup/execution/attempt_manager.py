"""The attempt manager: plays rises, judges and recovers, until the robot stands or needs help."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from drivers import DriverError, Ending, FaultKind, State
from drivers.control_loop import Pacer
from drivers.errors import UnreleasedError
from humanoid_getup.execution.recovery import RESTED, Recovery, StoppedError, UnrecoveredError
from humanoid_getup.execution.rise import Attempt, AttemptStatus, PlayedMove, Rise
from humanoid_getup.execution.session import Phase, PhaseChange, Session
from humanoid_getup.execution.stand_keeper import StandKeeper
from humanoid_getup.experiments.falls import UNCLASSED, classify
from humanoid_getup.experiments.judging.outcome import JointFigures, Outcome
from humanoid_getup.motions.posture_metric import measure_tilt
from humanoid_getup.playback.estimation import FaultedError, StartError, estimate_posture, settle
from humanoid_getup.playback.monitors import AbortKind
from humanoid_getup.playback.play import play_engaged
from humanoid_getup.playback.preflight import FAR_TILT, Verdict
from humanoid_getup.playback.supervisor import Supervisor
from humanoid_getup.strategies.plan import Plan, RiseStatus, Strategy
from robots import Posture

MOST_REMEDIES = 5  # faults of a robot at rest after which it is not recovered again
MOST_MOVES = 6  # to where there is room to rise, in one attempt
MOST_PLANS = 3  # that are refused by the preflight, one after the other
SEARCHED = {RiseStatus.STOOD, RiseStatus.MOVES}  # plans of a search: a second one may differ
MISSED = {AbortKind.TILT, AbortKind.FELL, AbortKind.STUCK}  # after these, a move still counts


class AttemptManager:
    """Gets a robot up, on any backend.

    Each attempt waits, torque off, until the robot is still, classifies how it lies, plans, runs
    the preflight, plays under supervision and judges. A plan that the preflight refuses is made
    again; after a move to where there is room, the robot settles and is planned for again. After a
    failed attempt it rests until every servo is cool; then the next one begins, up to a maximum.
    After that, or at a fault that rest does not clear, the robot needs help. A stop ends everything
    at once: nothing moves until the guard is cleared and a new rise is started. A robot that stands
    is kept standing, lies down, goes limp or is handed over, as the session requires.
    """

    def __init__(self, session: Session, strategy: Strategy, *, max_attempts: int = 3) -> None:
        if max_attempts < 1:
            raise ValueError(f"max_attempts is {max_attempts}, expected 1 or more")
        scene = session.world.scene
        if session.locate is None and not scene.is_flat:
            raise ValueError(
                f"scene '{scene.name}' is not the same everywhere, expected `locate`, which tells "
                "where in it the robot lies"
            )
        self._session, self._guard = session, session.guard
        self._strategy, self._max_attempts = strategy, max_attempts
        self._keeper = StandKeeper(session)
        self._number = 1
        self._moved = 0  # times
        self._recovery = Recovery(
            session.guard,
            cooling=session.cooling,
            services=session.services,
            realtime=session.realtime,
            report=lambda text: self._report(Phase.RECOVERING, text),
        )

    def get_up(self, rng: np.random.Generator) -> Rise:
        """Try until the robot stands, is stopped, or needs help; ``rng`` is for the plans.

        Raises:
            KeyboardInterrupt: if it was interrupted; the robot's torque is off then.
        """
        attempts: list[Attempt] = []
        by_fault = False
        with self._keeper.naming_hand_over():
            try:
                status, reason = self._try_all(attempts, rng)
            except StoppedError as stop:
                status, reason = AttemptStatus.STOPPED, f"{AttemptStatus.STOPPED.value}: {stop}"
            except (UnrecoveredError, DriverError) as error:
                status, reason, by_fault = AttemptStatus.NEEDS_HELP, str(error), True
            self._report(Phase.ENDED, reason)
            measured = next((a.start_class for a in attempts if a.start_class), UNCLASSED)
            return Rise(
                robot=self._guard.robot,
                start_class=self._session.start_class or measured,
                status=status,
                reason=reason,
                attempts=tuple(attempts),
                by_fault=by_fault or _ended_by_fault(attempts, status),
                has_imu=self._session.has_imu,
                unreleased=self._guard.unreleased,
            )

    def _try_all(
        self, attempts: list[Attempt], rng: np.random.Generator
    ) -> tuple[AttemptStatus, str]:
        """Append attempts until one succeeds or all are made; return how they ended."""
        most = self._max_attempts
        for number in range(1, most + 1):
            self._number = number
            attempt = self._attempt(rng)
            attempts.append(attempt)
            if attempt.release is not None:
                raise UnrecoveredError(f"{attempt.reason}; {attempt.release}")
            if attempt.stood:
                return AttemptStatus.STOOD, attempt.reason
            if attempt.is_unknown:
                return AttemptStatus.PLAYED, attempt.reason
            self._check_end(attempt)
            if self._number < most:
                self._recover(attempt)
        if most == 1:
            return AttemptStatus.NEEDS_HELP, attempts[0].reason
        reasons = "; ".join(f"{a.number}. {a.reason}" for a in attempts)
        return AttemptStatus.NEEDS_HELP, f"{most} attempts failed: {reasons}"

    def _attempt(self, rng: np.random.Generator) -> Attempt:
        """Plan and play, if necessary after moves to a place with room to rise."""
        moves: tuple[PlayedMove, ...] = ()
        refused: tuple[Plan, ...] = ()
        side: str | None = None
        while True:
            attempt, controller = self._prepare(rng)
            refused = (*refused, *attempt.refused)
            side = side or attempt.start_class
            attempt = replace(attempt, start_class=side, moves=moves, refused=refused)
            plan = attempt.plan
            if plan is None or controller is None:
                return attempt
            is_move = plan.status is RiseStatus.MOVES
            if is_move and len(moves) == MOST_MOVES:
                return replace(attempt, refusal=f"no room to rise after {MOST_MOVES} moves")
            self._report(Phase.PLAYING, plan.title)
            attempt = self._play(attempt, controller)
            if attempt.outcome is None or not (is_move and _has_moved(attempt)):
                return attempt
            if attempt.release is not None:
                return attempt
            moves = (*moves, PlayedMove(plan=plan, outcome=attempt.outcome))
            self._moved += 1
            self._session.moved(plan)

    def _prepare(self, rng: np.random.Generator) -> tuple[Attempt, Supervisor | None]:
        """Settle and plan; return the controller, ``None`` if nothing may be played."""
        refused: list[Plan] = []  # kept when the robot starts to move and planning ends
        try:
            attempt, controller = self._plan_until_passed(rng, refused)
        except StartError as error:
            attempt, controller = Attempt(number=self._number, refusal=str(error)), None
        return replace(attempt, refused=tuple(refused)), controller

    def _plan_until_passed(
        self, rng: np.random.Generator, refused: list[Plan]
    ) -> tuple[Attempt, Supervisor | None]:
        """Settle, plan and run the preflight; refused plans are appended to ``refused``."""
        state = self._settle()
        while True:
            posture = self._estimate(state)
            side = classify(posture.orientation) or UNCLASSED
            self._report(Phase.PLANNING, self._describe(side, len(refused)))
            plan = self._strategy.plan(posture, rng)
            attempt, controller = self._run_preflights(plan, state)
            attempt = replace(attempt, start_class=side)
            verdict = attempt.verdict
            if controller is not None or verdict is None or len(refused) + 1 == MOST_PLANS:
                return attempt, controller
            has_tipped = False
            if not verdict.passed:  # and not only the way down
                now = self._estimate(self._measure()).orientation
                has_tipped = measure_tilt(now, posture.orientation) > FAR_TILT
            if not has_tipped and not (verdict.another_may_pass and plan.status in SEARCHED):
                return attempt, None
            refused.append(plan)
            if has_tipped:
                state = self._settle()

    def _describe(self, side: str, refused: int) -> str:
        """Describe the planning: how the robot lies, and the reason to plan again."""
        text = f"the robot lies {side}"
        if self._moved:
            text += f", after {self._moved} move{'s' if self._moved > 1 else ''}"
        if refused:
            text += f", plan {refused + 1}: the preflight refused the one before"
        return text

    def _run_preflights(self, plan: Plan, state: State) -> tuple[Attempt, Supervisor | None]:
        """Run the preflight of a plan, and that of the way down after its stand."""
        session = self._session
        if not (session.balance and session.has_imu):
            plan = plan.open_loop() or plan
        attempt = Attempt(number=self._number, plan=plan)
        if not (plan.is_playable and session.preflight):
            return attempt, plan.controller(self._strategy)
        self._report(Phase.PREFLIGHT, plan.title)
        plan, verdict = self._preflight(plan, state)
        attempt = replace(attempt, plan=plan, verdict=verdict)
        if not verdict.passed:
            return replace(attempt, refusal=str(verdict)), None
        down = self._keeper.preflight(state)
        if not down.passed:
            return replace(attempt, refusal=f"the way down after the stand: {down}"), None
        return attempt, plan.controller(self._strategy)

    def _preflight(self, plan: Plan, state: State) -> tuple[Plan, Verdict]:
        """Judge a plan, and again without feedback if it falls; return the one to play."""
        strategy = self._strategy
        verdict = plan.preflight(strategy, state, self._measure_posture)
        other = plan.open_loop() if verdict.falls else None
        if other is not None:
            second = other.preflight(strategy, state, self._measure_posture)
            if second.passed:
                return other, second
        return plan, verdict

    def _settle(self) -> State:
        """Wait until the robot is still; recover from faults in the meantime."""
        for _ in range(MOST_REMEDIES):
            self._report(Phase.SETTLING, Phase.SETTLING.value)
            if not (self._session.settle or self._moved):
                return self._measure()
            pacer = Pacer(self._guard.period) if self._session.realtime else None
            try:
                return settle(self._guard, pacer)
            except FaultedError as error:
                fault = error.fault
            self._recovery.remedy(fault)
        raise UnrecoveredError(f"{fault}, {MOST_REMEDIES} times in a row")

    def _measure_posture(self) -> Posture:
        """Measure the robot's posture again."""
        return self._estimate(self._measure())

    def _estimate(self, state: State) -> Posture:
        if self._session.assumed_start is not None:
            return self._session.assumed_start
        world, locate = self._session.world, self._session.locate
        return estimate_posture(world, state, locate() if locate else None)

    def _measure(self) -> State:
        with self._guard:
            return self._guard.read()

    def _play(self, attempt: Attempt, controller: Supervisor) -> Attempt:
        """Play and judge an attempt; what stands is kept standing, or lies down."""
        judge, after = self._session.make_judge(), None
        report = release = None
        try:
            with self._keeper.engaged():
                report = play_engaged(
                    controller,
                    self._guard,
                    judge,
                    realtime=self._session.realtime,
                    on_cycle=self._keeper.watch,
                )
                completed = report.ending is Ending.DONE and controller.aborted is None
                may_stand = judge.end() in (True, None)  # without an IMU it is unknown
                if may_stand and completed:
                    may_balance = attempt.plan is not None and attempt.plan.balanced
                    after = self._keeper.keep(balanced=may_balance and self._session.balance)
        except UnreleasedError as error:
            if report is None:
                raise
            release, after = error, after and replace(after, release=error, hand_over=None)
        ended = judge.conclude()
        return replace(
            attempt,
            run=report,
            outcome=ended if isinstance(ended, Outcome) else None,
            joint_figures=ended if isinstance(ended, JointFigures) else None,
            abort=controller.aborted,
            warnings=tuple(controller.warnings),
            after=after,
            release=release,
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
        by_fault = attempt.run is not None and attempt.run.ending is Ending.FAULT
        if by_fault and fault is not None and fault.kind not in RESTED:
            self._recovery.remedy(fault)
        self._recovery.cool_down()

    def _report(self, phase: Phase, detail: str) -> None:
        self._session.on_phase(PhaseChange(phase, self._number, detail))


def _has_moved(attempt: Attempt) -> bool:
    """Return whether a move was played, even if it did not go as planned."""
    if attempt.run is None or attempt.run.ending is not Ending.DONE:
        return False
    return attempt.abort is None or attempt.abort.kind in MISSED


def _ended_by_fault(attempts: list[Attempt], status: AttemptStatus) -> bool:
    """Return whether a fault of the guard or the hardware ended the last attempt."""
    if status is not AttemptStatus.NEEDS_HELP or not attempts:
        return False
    last = attempts[-1].run
    return last is not None and last.ending is Ending.FAULT
