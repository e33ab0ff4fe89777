"""Loads the policy that an option names."""

from __future__ import annotations

from humanoid_getup.cli.errors import refusing
from humanoid_getup.policy.onnx_policy import LONGEST, OnnxPolicy, find_policy
from robots import Robot


def load_policy(
    robot: Robot, name: str, torque_limit: float | None, longest: float | None = None
) -> OnnxPolicy:
    """Load a policy of a robot by name, or an .onnx file.

    Raises:
        BadInputError: if there is no such policy, or it does not fit the robot.
    """
    with refusing():
        file = find_policy(robot, name)
        return OnnxPolicy.load(
            file, robot, robot.control_period, torque_limit, longest=longest or LONGEST
        )
