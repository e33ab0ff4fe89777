"""Loads the policy that an option names; alone, because it imports onnxruntime."""

from __future__ import annotations

from humanoid_getup.cli.errors import refusing
from humanoid_getup.policy.onnx_policy import LONGEST, OnnxPolicy, find_policy
from robots import Robot


def load_policy(
    robot: Robot, name: str, torque_limit: float | None, longest: float | None = None
) -> OnnxPolicy:
    """Load a policy of a robot by name, or an .onnx file."""
    with refusing():
        file, period = find_policy(robot, name), robot.control_period
        return OnnxPolicy.load(file, robot, period, torque_limit, longest=longest or LONGEST)
