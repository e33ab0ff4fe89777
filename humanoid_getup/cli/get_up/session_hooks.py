"""Hooks of sessions: phases and cycles for terminal, flight log and stop key."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TypeVar

from drivers import SafetyGuard
from humanoid_getup.cli.backends import BackendChoice
from humanoid_getup.cli.get_up.operator_key import OperatorKey
from humanoid_getup.cli.get_up.recording import FlightRecorder
from humanoid_getup.execution.phase import PhaseChange
from humanoid_getup.execution.session import SessionOptions
from humanoid_getup.jobs.errors import refusing

Result = TypeVar("Result")


class SessionHooks:
    """The hooks of a session, and the operator's key that they listen to."""

    def __init__(
        self,
        choice: BackendChoice,
        recorder: FlightRecorder,
        report: Callable[[str], None],
        terminal: int | None = None,
    ) -> None:
        """Prepare for an open backend; ``report`` shows a phase.

        The terminal of the key is a file descriptor; ``None`` for standard input.
        """
        self._choice, self._recorder, self._report = choice, recorder, report
        self._key = OperatorKey(realtime=choice.realtime, terminal=terminal)

    def join(self, options: SessionOptions) -> SessionOptions:
        """Add the fields of a session that its backend and its hooks determine to its options."""
        return replace(
            options,
            is_released=self._key.is_released,
            realtime=self._choice.realtime,
            simulation=self._choice.simulation,
            on_phase=self._note,
            on_cycle=self._recorder.log,
        )

    def work(self, guard: SafetyGuard, prepare: Callable[[], Callable[[], Result]]) -> Result:
        """Prepare the work, which may refuse it, and do it while the terminal is watched."""
        with refusing():
            work = prepare()
        with self._key.watch(guard):
            return work()

    def _note(self, change: PhaseChange) -> None:
        self._key.note(change)
        self._report(change.phase.value)
        self._recorder.note(change)
