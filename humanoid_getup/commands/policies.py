"""Trained policies for commands: by name from the robot's folder, or from a file."""

from __future__ import annotations

from pathlib import Path

from humanoid_getup.commands.errors import refusing
from humanoid_getup.policy import LONGEST, OnnxPolicy
from robots import Robot

SUFFIX = ".onnx"


def load_policy(
    robot: Robot, name: str, torque_limit: float | None, longest: float = LONGEST
) -> OnnxPolicy:
    """Load a policy of a robot by name, or an .onnx file.

    Raises:
        BadInputError: if there is none, or it does not fit.
    """
    with refusing():
        file = find_policy(robot, name)
        period = robot.control_period
        return OnnxPolicy.load(file, robot, period, torque_limit, longest=longest)


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
        told = ", ".join([*known, f"an {SUFFIX} file"])
        raise ValueError(f"unknown policy '{name}': allowed {told}")
    return folder / f"{name}{SUFFIX}"
