"""`getup sit` and `getup hold`: for a robot that stands already."""

from __future__ import annotations

from humanoid_getup.cli.backends import open_backend
from humanoid_getup.cli.get_up.recording import make_log, recording
from humanoid_getup.cli.get_up.results import naming_hand_over, write_stand_results
from humanoid_getup.cli.get_up.session_hooks import SessionHooks
from humanoid_getup.cli.shared.console import phase
from humanoid_getup.execution.session import Session, SessionOptions
from humanoid_getup.execution.stand_keeper import StandKeeper
from humanoid_getup.experiments.starts.falls import find_rest
from humanoid_getup.jobs.inputs import load_world, make_torque_limit
from humanoid_getup.jobs.requests.rise import HoldRequest, SitRequest


def sit(command: SitRequest) -> int:
    """Sit and lie down; return the exit code."""
    return _keep_stand(command)


def hold(command: HoldRequest) -> int:
    """Hold a stand, and end it; return the exit code."""
    return _keep_stand(command)


def _keep_stand(command: SitRequest | HoldRequest) -> int:
    world = load_world(command)
    at_rest = find_rest(world, world.robot.standing)
    limit = make_torque_limit(command, world.robot)
    opened = open_backend(command, world, limit)
    with phase("opening the backend") as report, opened as choice:
        with recording(make_log(command, world.robot)) as recorder:
            hooks, place = SessionHooks(choice, recorder, report), choice.place
            options = hooks.join(
                SessionOptions(then=command.ending, place=place and (lambda: place(at_rest)))
            )
            session = Session.on(choice.backend, world, limit, options)
            result = hooks.work(session.guard, lambda: StandKeeper(session).start)
        report("drawing")
        with naming_hand_over(result):
            return write_stand_results(result, world, command)
