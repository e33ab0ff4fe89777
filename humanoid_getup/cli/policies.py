"""Loads the policy that an option names."""

from __future__ import annotations

from pathlib import Path

from humanoid_getup.cli.errors import refusing
from humanoid_getup.policy.onnx_policy import LONGEST, OnnxPolicy
from robots import Robot

SUFFIX = ".onnx"


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


def find_policy(robot: Robot, name: str) -> Path:
    """Find the file of a policy.

    Raises:
        ValueError: naming the policies that the robot has.
    """
    if name.endswith(SUFFIX):
        return Path(name)
    folder = robot.folder / "policies"
    known = sorted(file.stem for file in folder.glob(f"*{SUFFIX}"))
    if name not in known:
        expected = ", ".join([*known, f"an {SUFFIX} file"])
        raise ValueError(f"unknown policy '{name}', expected {expected}")
    return folder / f"{name}{SUFFIX}"
