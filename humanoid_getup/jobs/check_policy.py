"""Compares a policy with a golden trace, or records one on the twin."""

from __future__ import annotations

from pathlib import Path

import msgspec
import numpy as np

from drivers import Twin
from humanoid_getup.jobs.errors import BadInputError, refusing
from humanoid_getup.jobs.inputs import find_start, load_robot
from humanoid_getup.jobs.policies import load_policy, name_robot
from humanoid_getup.jobs.requests.policies import CheckPolicyRequest
from humanoid_getup.policy.golden.checks import check_policy as compare
from humanoid_getup.policy.golden.comparison import Comparison
from humanoid_getup.policy.golden.recording import record_trace
from humanoid_getup.policy.golden.trace import FEWEST_ROWS, GoldenTrace
from humanoid_getup.policy.onnx_policy import OnnxPolicy
from humanoid_getup.progress.callback import Cancel, ProgressMonitor, Report
from humanoid_getup.scenes.scene import FLAT_SCENE
from humanoid_getup.simulation.world import World
from robots.storage.files import describe

START = "supine"  # of a recorded trace whose start is not given


class PolicyCheck(msgspec.Struct, frozen=True, kw_only=True):
    """How a policy compares with a trace, or which trace was recorded."""

    agrees: bool | None
    """Whether no boundary differs; None for a recorded trace."""
    steps: int
    """Policy steps of the trace."""
    comparisons: tuple[Comparison, ...] = ()
    recorded: str = ""
    """File of a recorded trace."""


def check_policy(
    request: CheckPolicyRequest, report: Report | None = None, cancel: Cancel | None = None
) -> PolicyCheck:
    """Compare the policy of a request with a trace, or record one.

    Raises:
        BadInputError: if policy, trace or start cannot be used, or do not fit each other.
        CancelledError: if ``cancel`` ended it; then nothing is written.
    """
    CheckPolicyRequest.accept(request)
    monitor = ProgressMonitor(report, cancel)
    monitor.begin("loading")
    request = name_robot(request, request.policy)
    policy = load_policy(load_robot(request), request.policy, None)
    if request.record is not None:
        return _record(request, policy, request.record, monitor)
    assert request.trace is not None
    monitor.begin("comparing")
    try:
        trace = GoldenTrace.load(request.trace)
        comparisons = tuple(compare(policy, trace))
    except (ValueError, OSError) as error:
        raise BadInputError(f"trace {request.trace}: {describe(error)}") from error
    return PolicyCheck(
        agrees=all(compared.agrees is not False for compared in comparisons),
        steps=len(trace),
        comparisons=comparisons,
    )


def _record(
    request: CheckPolicyRequest, policy: OnnxPolicy, file: Path, monitor: ProgressMonitor
) -> PolicyCheck:
    """Let the policy act on a twin that lies on flat ground, and write the trace."""
    robot = policy.robot
    if policy.contract.style is not None:
        raise BadInputError(
            f"policy '{request.policy}' follows style curves, which traces do not hold"
        )
    steps = max(round(request.seconds * policy.contract.rate_hz), FEWEST_ROWS)
    with refusing():
        robot.require_imu_site()
        world = World(robot, FLAT_SCENE)
        fall = find_start(world, request.origin or START, np.random.default_rng(request.seed))
        monitor.begin("recording")
        trace = record_trace(policy, Twin(robot, fall.posture), steps)
        monitor.check()
        file.parent.mkdir(parents=True, exist_ok=True)
        trace.save(file)
    return PolicyCheck(agrees=None, steps=len(trace), recorded=str(file))
