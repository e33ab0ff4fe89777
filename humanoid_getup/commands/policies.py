"""Loads the policy of an option; a file of its own, because it imports onnxruntime."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TypeVar

from humanoid_getup.commands.errors import refusing
from humanoid_getup.commands.inputs import load_robot_of
from humanoid_getup.commands.options import RobotOption
from humanoid_getup.policy.contract import PolicyContract
from humanoid_getup.policy.onnx_file import CONTRACT_KEY, read_metadata, read_model
from humanoid_getup.policy.onnx_policy import (
    LONGEST,
    SUFFIX,
    OnnxPolicy,
    find_policy,
    list_policies,
    read_contract,
)
from robots import Robot

DEFAULT_ROBOT = "op3"
Options = TypeVar("Options", bound=RobotOption)


def name_robot(options: Options, policy: str) -> Options:
    """Return the options of a command with its robot, by default that of the policy file."""
    if options.robot:
        return options
    if not policy.endswith(SUFFIX):
        return replace(options, robot=DEFAULT_ROBOT)
    with refusing():
        made_for = read_contract(Path(policy)).robot
    robot = load_robot_of(options, made_for, f"policy file {policy}")
    return replace(options, robot=robot.name)


def load_policy(
    robot: Robot, name: str, torque_limit: float | None, longest: float | None = None
) -> OnnxPolicy:
    """Load a policy of a robot by name, or an .onnx file."""
    with refusing():
        file, period = find_policy(robot, name), robot.control_period
        return OnnxPolicy.load(file, robot, period, torque_limit, longest=longest or LONGEST)


def list_styled_policies(robot: Robot) -> list[str]:
    """List the names of a robot's policies that follow style curves; none of them is run.

    Files that cannot be read are left out: they are reported when they are asked for.
    """
    return [file.stem for file in list_policies(robot) if _follows_styles(file)]


def _follows_styles(file: Path) -> bool:
    try:
        contract = read_metadata(read_model(file))[CONTRACT_KEY]
        return PolicyContract.from_json(contract).style is not None
    except (OSError, ValueError, KeyError):
        return False
