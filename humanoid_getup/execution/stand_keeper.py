"""The stand keeper: holds a standing robot, and ends the stand as requested."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import replace

import numpy as np

from drivers import (
    Command,
    Controller,
    Cycle,
    Ending,
    FaultKind,
    Release,
    RunReport,
    State,
    engaged,
    run_engaged,
)
from drivers.errors import NoImuError, UnreleasedError
from humanoid_getup.execution.after_stand import AfterStand, HandOver, Step, naming_hand_over
from humanoid_getup.execution.session import Phase, PhaseChange, Session
from humanoid_getup.experiments.judging.outcome import Outcome
from humanoid_getup.experiments.judging.standing import HOLD, StanceMeter, is_upright
from humanoid_getup.motions.motion import Motion
from humanoid_getup.motions.motion_database import find_lying_down
from humanoid_getup.playback.play import AnyJudge, play_engaged
from humanoid_getup.playback.preflight import Verdict, preflight
from humanoid_getup.playback.simulated_play import has_succeeded
from humanoid_getup.playback.supervisor import (
    make_stand,
    make_still,
    supervise_hold,
    supervise_motion,
)
from robots.kinematics import torso_orientation

HOLDING_TARGETS = "holding the last targets"


class StandKeeper:
    """Holds a robot in its stand, supervised, and ends the stand: lying, limp or handed over.

    The robot stays connected from the rise to the end of its stand, so that its servos always
    receive commands. A failure ends with torque off.
    """

    def __init__(self, session: Session) -> None:
        self._session, self._guard = session, session.guard
        self._limit = session.torque_limit.value
        self._sent: Command | None = None
        self._handed_over: HandOver | None = None
        self._balanced, self._ended = True, AfterStand()
        robot = session.world.robot
        self._way_down = find_lying_down(robot) if session.lies_down else None

    def preflight(self, settled: State) -> Verdict:
        """Judge the way down at the measured supply and temperatures; torque may be off."""
        if self._way_down is None or not self._session.preflight:
            return Verdict()
        return preflight(
            self._session.world,
            self._way_down,
            voltage=settled.voltage,
            torque_limit=self._session.torque_limit,
            temperature=settled.temperature,
        )

    @contextmanager
    def engaged(self) -> Iterator[None]:
        """Connect the robot for a rise and what follows; torque is off afterwards.

        Only a robot that was handed over keeps it.
        """
        backend = self._guard.backend
        before, self._sent, self._handed_over = backend.release, None, None
        try:
            with engaged(self._guard, realtime=self._session.realtime):
                yield
        finally:
            if backend.release is Release.LIMP:
                self._handed_over = None
            backend.release = before

    def naming_hand_over(self) -> AbstractContextManager[None]:
        """Name a robot that was handed over, if a block does not end."""
        return naming_hand_over(lambda: self._handed_over)

    def watch(self, cycle: Cycle) -> None:
        """Note a cycle; the next run continues from its targets."""
        self._sent = cycle.sent
        if self._session.on_cycle is not None:
            self._session.on_cycle(cycle)

    def keep(self, *, balanced: bool = True) -> AfterStand:
        """Hold a judged stand or follow the pilot, on the engaged robot, and end it.

        ``balanced`` is False to hold the stand without feedback to the ankles. An interrupt of the
        hold ends it with torque off, and is in the result.

        Raises:
            KeyboardInterrupt: if the pilot was interrupted; the robot's torque goes off then.
        """
        self._balanced = balanced
        if self._session.pilot is not None:
            after = AfterStand(followed=self._follow(self._session.pilot))
            return self._end(after) if after.succeeded else after
        hold = self._hold(0.0) if self._session.then == "hold" else None
        if hold is not None and not hold.is_done:
            return AfterStand(hold=hold)
        return self._end(AfterStand(hold=hold))

    def start(self) -> AfterStand:
        """Take over a robot that stands already: hold it for a judged stand at least, and end it.

        With ``then`` at ``"sit"``, it sits down at once.
        """
        try:
            with self.naming_hand_over():
                return self._start()
        except UnreleasedError as error:
            return replace(self._ended, release=error, hand_over=None)

    def _start(self) -> AfterStand:
        with self._guard:
            self._place()
            state = self._guard.read()
            self._guard.write(Command.limp(self._guard.robot.n))
            if self._guard.fault is not None:
                return AfterStand(refusal=str(self._guard.fault), refused_by_fault=True)
            refusal = self._find_refusal(state)
        if refusal:
            return AfterStand(refusal=refusal)
        with self.engaged():
            self._place()
            # A robot that a person holds may have been let go meanwhile.
            is_real = self._session.place is None
            if is_real and (refusal := self._find_lean(self._guard.read())):
                return AfterStand(refusal=refusal)
            hold = None
            if self._session.then != "sit":
                hold = self._hold(HOLD)
                if not hold.is_done and not (hold.ran and self._way_down is not None):
                    self._ended = AfterStand(hold=hold)
                    return self._ended
            self._ended = self._end(AfterStand(hold=hold))
            return self._ended

    def _place(self) -> None:
        """Place a simulated robot, which fell when its torque was off."""
        if self._session.place is not None:
            self._session.place()
            # The first reply of a bus may be of the time before: a cycle later it is not.
            self._guard.write(Command.limp(self._guard.robot.n))

    def _find_refusal(self, state: State) -> str | None:
        # In real time, a simulated robot sinks in the time that passes until it is measured.
        if self._session.place is None and (lean := self._find_lean(state)):
            return lean
        verdict = self.preflight(state)
        return None if verdict.passed else str(verdict)

    def _find_lean(self, state: State) -> str | None:
        """Return why a robot does not stand, by its sensors."""
        robot, model = self._session.world.robot, self._session.world.model
        if not state.has_imu:
            raise NoImuError(robot.name)
        torso = torso_orientation(robot, model, state.orientation)
        stance = StanceMeter(robot, model).estimate(torso[None], state.joint_pos[None])
        if is_upright(stance, robot)[0]:
            return None
        return (
            f"the robot does not stand: its torso is {np.degrees(stance.tilt[0]):.0f}° from "
            f"upright, its neck at {stance.neck_height[0] / robot.standing_neck_height:.0%} "
            "of the standing height: expected a robot that stands, held by a person while "
            "its torque is off"
        )

    def _hold(self, least: float) -> Step:
        session = self._session
        self._report(Phase.HOLDING, "" if session.has_imu else HOLDING_TARGETS)
        stand = StandWatch(session.make_judge, session.is_released) if least else None
        supervisor = supervise_hold(
            session.world,
            self._choose_posture(),
            least=least,
            is_released=stand.may_end if stand else session.is_released,
            torque_limit=self._limit,
            held=self._held,
            balanced=self._balanced if session.has_imu else None,
        )

        def watch(cycle: Cycle) -> None:
            self.watch(cycle)
            if stand is not None:
                stand(cycle)

        try:
            run = self._run(supervisor, supervisor.longest, watch, Phase.HOLDING)
        finally:
            if stand is not None:
                stand.end()
        stood = stand is None or stand.stood
        return Step(run=run, abort=supervisor.aborted, succeeded=stood)

    def _follow(self, pilot: Controller) -> Step:
        self._report(Phase.FOLLOWING)
        run = self._run(pilot, math.inf, self.watch, Phase.FOLLOWING)
        if run.ending is Ending.INTERRUPTED:
            raise KeyboardInterrupt
        return Step(run=run)

    def _run(
        self,
        controller: Controller,
        max_time: float,
        on_cycle: Callable[[Cycle], None],
        phase: Phase,
    ) -> RunReport:
        """Run a controller of a robot that stands; after a pause it begins again where it is."""
        guard, session, past = self._guard, self._session, 0.0
        while True:
            run = run_engaged(
                controller, guard, max_time=max_time, realtime=session.realtime, on_cycle=on_cycle
            )
            past += run.duration
            is_paused = guard.fault is not None and guard.fault.kind is FaultKind.PAUSED
            if not (is_paused and session.has_imu) or self._find_lean(guard.read()):
                return replace(run, duration=past)
            self._report(phase, f"{run.reason}: held where it is, and on from there")
            guard.resume()

    def _choose_posture(self) -> Motion:
        """Return the posture to hold: the stand, or without an IMU the last targets."""
        robot, held = self._session.world.robot, self._held
        if self._session.has_imu or held is None:
            return make_stand(robot)
        return make_still(robot, held)

    def _end(self, after: AfterStand) -> AfterStand:
        """End the stand as requested, after a hold or a pilot."""
        if self._session.then == "hand-over":
            return self._hand_over(after)
        return replace(after, way_down=self._lie_down())

    def _lie_down(self) -> Step | None:
        if self._way_down is None:
            return None
        self._report(Phase.LYING_DOWN)
        session = self._session
        judge = session.make_judge()
        supervisor = supervise_motion(
            session.world, self._way_down, torque_limit=self._limit, held=self._held
        )
        run = play_engaged(
            supervisor, self._guard, judge, realtime=session.realtime, on_cycle=self.watch
        )
        if run.ending is Ending.DONE:  # it rests, and judging takes longer than a cycle
            self._guard.write(Command.limp(self._guard.robot.n))
        outcome = judge.conclude()
        assert isinstance(outcome, Outcome)  # a robot without an IMU does not lie down
        lies = bool(has_succeeded(self._way_down, outcome))
        return Step(run=run, abort=supervisor.aborted, outcome=outcome, succeeded=lies)

    def _hand_over(self, after: AfterStand) -> AfterStand:
        """Leave the servos under torque, if each confirms it and no stop came meanwhile."""
        if unconfirmed := self._try_hand_over():
            reason = f"not handed over: {', '.join(unconfirmed)} did not confirm it"
            self._report(Phase.HOLDING, f"{reason}: held on, then tried again")
            hold = self._hold(HOLD)
            if not hold.is_done:
                return replace(after, hold=hold)
            if self._try_hand_over():
                return replace(after, refusal=f"{reason}; torque off", refused_by_fault=True)
        if stop := self._guard.check_stop():
            return replace(after, refusal=f"{stop}; torque off", refused_by_fault=True)
        return replace(after, hand_over=self._handed_over)

    def _try_hand_over(self) -> tuple[str, ...]:
        """Leave the servos under torque; return the joints that do not confirm it."""
        guard = self._guard
        assert self._sent is not None
        # Before, so that an interrupt at any moment finds it.
        self._handed_over = HandOver(robot=guard.robot, command=self._sent, limit_by=guard.limit_by)
        return guard.hand_over()

    @property
    def _held(self) -> np.ndarray | None:
        return None if self._sent is None else self._sent.joint_pos

    def _report(self, phase: Phase, detail: str = "") -> None:
        self._session.on_phase(PhaseChange(phase, 1, detail or phase.value))


LONGEST_WAIT = 3.0 * HOLD  # s that a released robot is still held without a judged stand


class StandWatch:
    """Judges a long stand in pieces until one piece is a held stand.

    A judge keeps every sample, so one that watched for hours would fill the memory and be late.
    """

    def __init__(self, make_judge: Callable[[], AnyJudge], is_released: Callable[[], bool]) -> None:
        self._make_judge, self._is_released = make_judge, is_released
        self._judge = make_judge()
        self._began: float | None = None
        self._released_at: float | None = None
        self._now = 0.0
        self.stood = False
        """Whether a held stand was observed."""

    def __call__(self, cycle: Cycle) -> None:
        """Observe a cycle."""
        self._now = cycle.state.time
        if self.stood:
            return
        self._judge(cycle)
        if self._began is None:
            self._began = self._now
        if self._now - self._began >= HOLD:
            self.stood = bool(self._judge.end())
            if not self.stood:
                self._judge, self._began = self._make_judge(), None

    def may_end(self) -> bool:
        """Return whether the robot is released, and has stood or will not stand."""
        if not self._is_released():
            self._released_at = None
            return False
        if self._released_at is None:
            self._released_at = self._now
        return self.stood or self._now - self._released_at > LONGEST_WAIT

    def end(self) -> None:
        """Stop observing."""
        self._judge.end()
