"""Hooks of sessions: phases and cycles for progress, cancellation, flight log and operator."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import replace
from importlib.util import find_spec
from typing import Protocol, TypeVar

from drivers import Cycle, GuardLimits, SafetyGuard
from humanoid_getup.commands.backends import BackendChoice, CancellableGuard
from humanoid_getup.commands.errors import BadInputError
from humanoid_getup.commands.get_up.options import MP4, MoveOptions
from humanoid_getup.commands.get_up.recording import FlightRecorder
from humanoid_getup.commands.viewer import viewing
from humanoid_getup.execution.after_stand import AfterStand, naming_hand_over
from humanoid_getup.execution.rise import Rise
from humanoid_getup.execution.session import Phase, PhaseChange, Session, SessionOptions
from humanoid_getup.progress.callback import ProgressMonitor
from humanoid_getup.simulation.world import World
from robots import TorqueLimit

Result = TypeVar("Result", Rise, AfterStand)


class Operator(Protocol):
    """Releases a robot that is held, and may stop one that moves, by its guard."""

    def is_released(self) -> bool:
        """Return whether a held robot may sit down; called every cycle of the hold."""
        ...

    def note(self, change: PhaseChange, /) -> None:
        """Note the beginning of a phase."""
        ...

    def watch(self, guard: SafetyGuard, /) -> AbstractContextManager[None]:
        """Watch while a robot moves; its guard can be stopped from any thread."""
        ...


class NoOperator:
    """Stands in where there is no operator: a robot that is held counts as released."""

    def is_released(self) -> bool:
        """Return True."""
        return True

    def note(self, _change: PhaseChange) -> None:
        """Ignore a phase."""

    def watch(self, _guard: SafetyGuard) -> AbstractContextManager[None]:
        """Watch nothing."""
        return nullcontext()


class SessionHooks:
    """The hooks of a session, and the operator that they inform."""

    def __init__(
        self,
        request: MoveOptions,
        choice: BackendChoice,
        recorder: FlightRecorder,
        monitor: ProgressMonitor,
        operator: Operator,
    ) -> None:
        """Prepare for an open backend."""
        self._request, self._choice, self._recorder = request, choice, recorder
        self._show: Callable[[Cycle], None] = lambda _: None
        self._monitor, self._operator = monitor, operator

    def begin(self, world: World, limit: TorqueLimit, options: SessionOptions) -> Session:
        """Begin a session with the robot of the backend, in a world; show what its driver found."""
        for warning in self._choice.warnings:
            self._monitor.tell(warning)
        limits = GuardLimits.of(world.robot, limit.value)
        guard = CancellableGuard(self._choice.backend, limits, self._monitor.check)
        return Session.on(guard, world, limit, self.join(options))

    def join(self, options: SessionOptions) -> SessionOptions:
        """Add the fields of a session that its backend and its hooks determine to its options."""
        return replace(
            options,
            is_released=self._operator.is_released,
            realtime=self._choice.realtime,
            simulation=self._choice.simulation,
            on_phase=self._note,
            on_cycle=self._log,
        )

    def work(self, session: Session, work: Callable[[], Result]) -> Result:
        """Do the work while the operator watches.

        A robot that was handed over keeps its torque: then it is too late to cancel.
        """
        check_video(self._request)
        guard, realtime = session.guard, self._choice.realtime
        result: Result | None = None
        with (
            naming_hand_over(lambda: result and result.hand_over),
            self._operator.watch(guard),
            viewing(self._request, session.world, realtime=realtime) as self._show,
        ):
            result = work()
        if result.hand_over is not None:
            if stop := guard.check_stop():  # it came too late for the session: taken back
                with guard.backend:
                    pass
                raise KeyboardInterrupt(f"{stop}; torque off")
            self._monitor.commit()
        return result

    def _log(self, cycle: Cycle) -> None:
        self._recorder.log(cycle)
        self._show(cycle)

    def _note(self, change: PhaseChange) -> None:
        self._operator.note(change)
        self._recorder.note(change)
        if change.phase is not Phase.ENDED:
            waits = change.phase is Phase.HOLDING and not self._operator.is_released()
            self._monitor.begin(change.phase.value + ", until a key is pressed" * waits)


def check_video(request: MoveOptions) -> None:
    """Check that a video can be made, before the robot moves."""
    if request.video is not None and request.video.suffix.lower() == MP4 and not find_spec("av"):
        raise BadInputError(
            f"--video {request.video} requires package 'av', expected .gif without it: "
            "pip install 'humanoid-getup[studio]'"
        )
