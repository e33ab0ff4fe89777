"""`getup sit` and `getup hold`, of a robot that stands."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal

from rich.console import Console
from rich.markup import escape

from humanoid_getup.commands.backends import open_backend
from humanoid_getup.commands.command import command
from humanoid_getup.commands.errors import (
    DID_IT,
    DID_NOT_STAND,
    HARDWARE_FAULT,
    INTERRUPTED,
)
from humanoid_getup.commands.get_up.operator_key import watch_key
from humanoid_getup.commands.get_up.options import MoveOptions
from humanoid_getup.commands.get_up.recording import make_log, recording
from humanoid_getup.commands.get_up.results import FinishedStand, finish_stand
from humanoid_getup.commands.get_up.session_hooks import NoOperator, Operator, SessionHooks
from humanoid_getup.commands.inputs import load_world, make_torque_limit
from humanoid_getup.commands.options import LoadOption
from humanoid_getup.execution.after_stand import AfterStand, naming_hand_over
from humanoid_getup.execution.session import SessionOptions
from humanoid_getup.execution.stand_keeper import StandKeeper
from humanoid_getup.experiments.falls import UNCLASSED, Fall, find_rest
from humanoid_getup.progress.callback import ProgressMonitor


@dataclass(frozen=True, kw_only=True)
class SitRequest(LoadOption, MoveOptions):
    """Sit and lie down from a stand, then torque off.

    A simulated robot starts standing; a real one is held by a person until it moves.
    """

    then: ClassVar[Literal["sit"]] = "sit"
    ending: ClassVar[Literal["sit"]] = "sit"


@dataclass(frozen=True, kw_only=True)
class HoldRequest(LoadOption, MoveOptions):
    """Hold a robot in its stand, supervised, until a key is pressed.

    A simulated robot starts standing; a real one is held by a person until it has torque. In
    simulated time or without a terminal, the stand is held just long enough to be judged.
    """

    then: Literal["sit", "limp", "hand-over"] = "sit"
    """After that: sit and lie down, torque off where it stands, or leave torque on for another
    program."""

    @property
    def ending(self) -> Literal["hold", "limp", "hand-over"]:
        """What the robot does: it is always held first."""
        return "hold" if self.then == "sit" else self.then


@command("sit", json=FinishedStand.describe, person=watch_key, in_lines=True)
def sit(
    request: SitRequest, monitor: ProgressMonitor, *, operator: Operator | None = None
) -> FinishedStand:
    """Sit and lie down; errors are those of `rise`."""
    return _keep_stand(request, monitor, operator or NoOperator())


@command("hold", json=FinishedStand.describe, person=watch_key, in_lines=True)
def hold(
    request: HoldRequest, monitor: ProgressMonitor, *, operator: Operator | None = None
) -> FinishedStand:
    """Hold a stand until the operator releases it, and end it; errors are those of `rise`.

    Without an operator it is held just long enough to be judged.
    """
    return _keep_stand(request, monitor, operator or NoOperator())


def _keep_stand(
    request: SitRequest | HoldRequest, monitor: ProgressMonitor, operator: Operator
) -> FinishedStand:
    monitor.begin("loading")
    world = load_world(request)
    stand = Fall(posture=find_rest(world, world.robot.standing), start_class=UNCLASSED)
    limit = make_torque_limit(request, world.robot)
    monitor.begin("opening the backend")
    log = make_log(request, world.robot)
    result: AfterStand | None = None
    with (
        naming_hand_over(lambda: result and result.hand_over),
        open_backend(request, world, limit) as choice,
        recording(log, monitor.tell) as recorder,
    ):
        hooks, place = SessionHooks(request, choice, recorder, monitor, operator), choice.place
        options = SessionOptions(
            then=request.ending, place=place and (lambda: place(stand.posture))
        )
        session = hooks.begin(world, limit, options)
        result = hooks.work(session, StandKeeper(session).start)
    monitor.begin("drawing")
    return finish_stand(result, world, request, request.then, stand if place else None)


@sit.show
@hold.show
def _print(done: FinishedStand, _: MoveOptions, console: Console) -> int:
    result = done.stand
    console.print(f"[bold {'green' if result.succeeded else 'red'}]{escape(result.reason)}")
    if result.hand_over is not None:
        console.print(escape(str(result.hand_over)))
    if result.succeeded:
        return DID_IT
    if result.interrupted:
        return INTERRUPTED
    return HARDWARE_FAULT if result.by_fault else DID_NOT_STAND
