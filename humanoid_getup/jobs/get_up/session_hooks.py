"""Hooks of sessions: phases and cycles for progress, cancellation, flight log and operator."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Protocol, TypeVar

from drivers import Backend, GuardLimits, SafetyGuard, State
from humanoid_getup.execution.after_stand import HandOver
from humanoid_getup.execution.phase import Phase, PhaseChange
from humanoid_getup.execution.session import SessionOptions
from humanoid_getup.jobs.backends import BackendChoice
from humanoid_getup.jobs.errors import refusing
from humanoid_getup.jobs.get_up.operator import Operator
from humanoid_getup.jobs.get_up.recording import FlightRecorder
from humanoid_getup.progress.callback import ProgressMonitor
from robots import TorqueLimit


class EndsWithRobot(Protocol):
    """Result of moving a robot, whose torque is off unless it was handed over."""

    @property
    def hand_over(self) -> HandOver | None:
        """Return the state in which it was handed over, if it was."""
        ...


Result = TypeVar("Result", bound=EndsWithRobot)


class CancellableGuard(SafetyGuard):
    """A guard that checks in every cycle whether the work is canceled, and then measures."""

    def __init__(self, backend: Backend, limits: GuardLimits, check: Callable[[], None]) -> None:
        """Guard a backend; ``check`` raises `CancelledError` to end the work."""
        super().__init__(backend, limits)
        self._check = check

    def read(self) -> State:
        """Measure the robot.

        Raises:
            CancelledError: if the work is canceled; torque goes off with the connection.
        """
        self._check()
        return super().read()


class SessionHooks:
    """The hooks of a session, and the operator that they inform."""

    def __init__(
        self,
        choice: BackendChoice,
        recorder: FlightRecorder,
        monitor: ProgressMonitor,
        operator: Operator,
    ) -> None:
        """Prepare for an open backend."""
        self._choice, self._recorder = choice, recorder
        self._monitor, self._operator = monitor, operator

    def guard(self, limit: TorqueLimit) -> SafetyGuard:
        """Make the guard of the backend, which keeps to a torque limit."""
        backend = self._choice.backend
        limits = GuardLimits.of(backend.robot, limit.value)
        return CancellableGuard(backend, limits, self._monitor.check)

    def join(self, options: SessionOptions) -> SessionOptions:
        """Add the fields of a session that its backend and its hooks determine to its options."""
        return replace(
            options,
            is_released=self._operator.is_released,
            realtime=self._choice.realtime,
            simulation=self._choice.simulation,
            on_phase=self._note,
            on_cycle=self._recorder.log,
        )

    def work(self, guard: SafetyGuard, prepare: Callable[[], Callable[[], Result]]) -> Result:
        """Prepare the work, which may refuse it, and do it while the operator watches.

        A robot that was handed over keeps its torque: then it is too late to cancel.
        """
        with refusing():
            work = prepare()
        with self._operator.watch(guard):
            result = work()
        if result.hand_over is not None:
            self._monitor.commit()
        return result

    def _note(self, change: PhaseChange) -> None:
        self._operator.note(change)
        self._recorder.note(change)
        if change.phase is not Phase.ENDED:
            self._monitor.begin(change.phase.value)
