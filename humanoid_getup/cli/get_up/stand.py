"""`getup sit` and `getup hold`: for a robot that stands already."""

from __future__ import annotations

from collections.abc import Callable

from humanoid_getup.cli.get_up.operator_key import OperatorKey
from humanoid_getup.cli.get_up.results import show_stand, showing_phases
from humanoid_getup.jobs.get_up import stand as jobs
from humanoid_getup.jobs.get_up.results import FinishedStand
from humanoid_getup.jobs.requests.rise import HoldRequest, SitRequest


def sit(command: SitRequest) -> int:
    """Sit and lie down; return the exit code."""
    return _keep_stand(jobs.sit, command)


def hold(command: HoldRequest) -> int:
    """Hold a stand, and end it; return the exit code."""
    return _keep_stand(jobs.hold, command)


def _keep_stand(job: Callable[..., FinishedStand], command: SitRequest | HoldRequest) -> int:
    with showing_phases() as report:
        done = job(command, report, operator=OperatorKey(realtime=command.is_realtime))
    return show_stand(done, command)
