"""`getup rise`, `run` and `play`: rises by different strategies."""

from __future__ import annotations

from collections.abc import Callable

from humanoid_getup.cli.get_up.operator_key import OperatorKey
from humanoid_getup.cli.get_up.results import show_rise, showing_phases
from humanoid_getup.jobs.get_up import rise as jobs
from humanoid_getup.jobs.get_up.results import FinishedRise
from humanoid_getup.jobs.requests.rise import GetUpOptions, PlayRequest, RiseRequest, RunRequest


def rise(command: RiseRequest) -> int:
    """Rise by plan, by policy, or by the better of both; return the exit code."""
    return _get_up(jobs.rise, command)


def run_policy(command: RunRequest) -> int:
    """Rise once by a policy; return the exit code."""
    return _get_up(jobs.run_policy, command)


def play(command: PlayRequest) -> int:
    """Rise once by one motion; return the exit code."""
    return _get_up(jobs.play_motion, command)


def _get_up(job: Callable[..., FinishedRise], command: GetUpOptions) -> int:
    with showing_phases() as report:
        done = job(command, report, operator=OperatorKey(realtime=command.is_realtime))
    return show_rise(done, command)
