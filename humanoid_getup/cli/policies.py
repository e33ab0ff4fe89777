"""Loads the policy that an option names; alone, because it imports onnxruntime."""

from __future__ import annotations

from humanoid_getup.cli.errors import BadInputError, refusing
from humanoid_getup.cli.options.shared import A_POLICY
from humanoid_getup.policy.onnx_policy import LONGEST, OnnxPolicy, find_policy
from robots import Robot


def load_policy(
    robot: Robot, name: str, torque_limit: float | None, longest: float | None = None
) -> OnnxPolicy:
    """Load a policy of a robot by name, or an .onnx file; it knows the original body alone."""
    if not robot.body.is_original:
        raise BadInputError(
            f"--body is {robot.body}, expected none, or plans without policy '{name}': {A_POLICY}"
        )
    with refusing():
        file, period = find_policy(robot, name), robot.control_period
        return OnnxPolicy.load(file, robot, period, torque_limit, longest=longest or LONGEST)
