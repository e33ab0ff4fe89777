"""Jobs for a robot that stands already: to sit and lie down, and to be held."""

from __future__ import annotations

from humanoid_getup.commands.backends import open_backend
from humanoid_getup.commands.errors import refusing
from humanoid_getup.commands.inputs import load_world, make_torque_limit
from humanoid_getup.execution.after_stand import AfterStand, naming_hand_over
from humanoid_getup.execution.session import SessionOptions
from humanoid_getup.execution.stand_keeper import StandKeeper
from humanoid_getup.experiments.starts.falls import UNCLASSED, Fall, find_rest
from humanoid_getup.jobs.get_up.recording import make_log, recording
from humanoid_getup.jobs.get_up.results import FinishedStand, finish_stand
from humanoid_getup.jobs.get_up.session_hooks import NoOperator, Operator, SessionHooks
from humanoid_getup.jobs.requests.rise import HoldRequest, SitRequest
from humanoid_getup.progress.callback import Cancel, ProgressMonitor, Report


def sit(
    request: SitRequest,
    report: Report | None = None,
    cancel: Cancel | None = None,
    *,
    operator: Operator | None = None,
) -> FinishedStand:
    """Sit and lie down; errors are those of `rise`."""
    SitRequest.accept(request)
    return _keep_stand(request, ProgressMonitor(report, cancel), operator or NoOperator())


def hold(
    request: HoldRequest,
    report: Report | None = None,
    cancel: Cancel | None = None,
    *,
    operator: Operator | None = None,
) -> FinishedStand:
    """Hold a stand until the operator releases it, and end it; errors are those of `rise`.

    Without an operator it is held just long enough to be judged.
    """
    HoldRequest.accept(request)
    return _keep_stand(request, ProgressMonitor(report, cancel), operator or NoOperator())


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
        with refusing():
            keeper = StandKeeper(session)
        result = hooks.work(session, keeper.start)
    monitor.begin("drawing")
    return finish_stand(result, world, request, stand if place else None)
