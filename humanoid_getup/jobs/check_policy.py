"""Compares a policy with a trace of it."""

from __future__ import annotations

import msgspec

from humanoid_getup.jobs.errors import BadInputError
from humanoid_getup.jobs.inputs import load_robot
from humanoid_getup.jobs.policies import load_policy, name_robot
from humanoid_getup.jobs.requests.policies import CheckPolicyRequest
from humanoid_getup.policy.parity import Comparison, compare_policy, load_trace
from humanoid_getup.progress.callback import Cancel, ProgressMonitor, Report
from robots.storage.files import describe


class PolicyCheck(msgspec.Struct, frozen=True, kw_only=True):
    """How a policy compares with a trace."""

    agrees: bool
    steps: int
    """Policy steps of the trace."""
    comparisons: tuple[Comparison, ...]


def check_policy(
    request: CheckPolicyRequest, report: Report | None = None, cancel: Cancel | None = None
) -> PolicyCheck:
    """Compare observations and actions of the policy of a request with those of a trace.

    Raises:
        BadInputError: if policy or trace cannot be used, or do not fit each other.
        CancelledError: if ``cancel`` ended it.
    """
    CheckPolicyRequest.accept(request)
    ProgressMonitor(report, cancel).begin("comparing")
    request = name_robot(request, request.policy)
    robot = load_robot(request)
    policy = load_policy(robot, request.policy, None)
    try:
        trace = load_trace(request.trace, robot)
        comparisons = compare_policy(policy, trace)
    except (ValueError, OSError) as error:
        raise BadInputError(f"trace {request.trace}: {describe(error)}") from error
    return PolicyCheck(
        agrees=all(compared.agrees for compared in comparisons),
        steps=len(trace["time"]),
        comparisons=comparisons,
    )
