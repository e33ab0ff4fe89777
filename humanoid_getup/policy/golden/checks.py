"""The checks of a policy against a golden trace, boundary by boundary."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from humanoid_getup.policy.foreign.joint_names import map_joints
from humanoid_getup.policy.golden.action_check import check_action
from humanoid_getup.policy.golden.comparison import Boundary, Comparison
from humanoid_getup.policy.golden.observation_check import check_observation
from humanoid_getup.policy.golden.physics_check import check_physics
from humanoid_getup.policy.golden.replayed import ReplayedPolicy
from humanoid_getup.policy.golden.torque_check import check_torque
from humanoid_getup.policy.golden.trace import OPTIONAL_KEYS, GoldenTrace
from humanoid_getup.policy.onnx_policy import OnnxPolicy
from robots import Robot
from robots.storage.arrays import ArchiveError

JOINT_KEYS = ("joint_pos", "joint_vel", *(k for k, shape in OPTIONAL_KEYS.items() if "n" in shape))
RATE_SLACK = 0.01  # share
STEP_SLACK = 0.5  # of a policy step, by which distances of rows may differ


def check_policy(policy: OnnxPolicy, trace: GoldenTrace) -> list[Comparison]:
    """Check a policy at each boundary; behind the first that differs, A to C are not compared.

    Raises:
        ArchiveError: if the trace does not fit: other joints, sizes or rate.
        ForeignPolicyError: if its joints are not the robot's.
    """
    trace = order_trace(trace, policy.robot)
    replayed = ReplayedPolicy(policy, trace)
    _check_sizes(replayed)
    comparisons: list[Comparison] = []
    for boundary, check in (
        (Boundary.OBSERVATION, check_observation),
        (Boundary.ACTION, check_action),
        (Boundary.TORQUE, check_torque),
    ):
        before = next((each for each in comparisons if each.agrees is False), None)
        if before is None:
            comparisons.append(check(replayed))
        else:
            cause = f"differs before, at {before.boundary}"
            comparisons.append(Comparison(boundary=boundary, agrees=None, cause=cause))
    return [*comparisons, check_physics(trace, policy.robot)]


def order_trace(trace: GoldenTrace, robot: Robot) -> GoldenTrace:
    """Bring the joints of a trace into the robot's order.

    Raises:
        ArchiveError: if it lacks one.
        ForeignPolicyError: if it has others.
    """
    places = list(map_joints(trace.joints, robot).values())
    if len(places) < robot.n:
        lacking = [name for i, name in enumerate(robot.joint_names) if i not in places]
        raise ArchiveError(f"joints lacks {', '.join(lacking)}")
    order = np.argsort(places)
    arrays = {key: getattr(trace, key) for key in JOINT_KEYS}
    ordered = {key: value[..., order] for key, value in arrays.items() if value is not None}
    return replace(trace, joints=robot.joint_names, **ordered)


def _check_sizes(replayed: ReplayedPolicy) -> None:
    trace, policy = replayed.trace, replayed.policy
    k = len(replayed.record.moved) if replayed.record else policy.action.size
    problems = [
        f"{name} has {found} columns, expected {wanted}"
        for name, found, wanted in (
            ("observation", trace.observation.shape[1], replayed.size),
            ("action", trace.action.shape[1], k),
        )
        if found != wanted
    ]
    steps = np.diff(trace.time)
    rate = 1.0 / float(np.median(steps))
    if np.ptp(steps) * rate > STEP_SLACK:
        problems.append(
            f"its rows are {steps.min():.3g} to {steps.max():.3g} s apart, expected each policy "
            "step once"
        )
    if abs(rate / policy.contract.rate_hz - 1.0) > RATE_SLACK:
        problems.append(f"its rows are {rate:.4g} Hz, expected {policy.contract.rate_hz:.4g} Hz")
    if policy.contract.style is not None:
        problems.append("the policy follows style curves, which traces do not hold")
    if problems:
        raise ArchiveError("; ".join(problems))
