"""Command of the plugin: ``python -m lerobot_robot_getup calibration to-lerobot|from-lerobot``."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from drivers.errors import DriverError
from drivers.service.calibrate import save
from humanoid_getup.cli.shared.exit_codes import BAD_INPUT
from humanoid_getup.jobs.errors import BadInputError, refusing
from humanoid_getup.jobs.inputs import load_robot
from humanoid_getup.jobs.requests.shared import RobotOption
from lerobot_robot_getup.lerobot_calibration import (
    find_calibration,
    load_calibration,
    measure_joints,
    save_calibration,
)
from robots import Robot, load_posture
from robots.quaternion import Array


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; return its exit code."""
    options = _make_parser().parse_args(arguments)
    try:
        with refusing():
            options.work(options)
    except (BadInputError, DriverError) as error:
        print(error, file=sys.stderr)
        return BAD_INPUT
    return 0


def convert_to_lerobot(options: argparse.Namespace) -> None:
    """Write LeRobot's calibration file of a robot."""
    robot = load_robot(RobotOption(robot=options.robot))
    save_calibration(find_calibration(robot), options.out)
    print(f"{options.out}: {robot.n} joints of robot '{robot.name}'")


def convert_from_lerobot(options: argparse.Namespace) -> None:
    """Write a robot's calibration.toml from LeRobot's calibration file."""
    robot = load_robot(RobotOption(robot=options.robot))
    angles = _find_angles(robot, options.homed_at)
    measured = measure_joints(robot, load_calibration(options.file), angles, options.directions)
    for each in measured:
        for warning in each.warnings:
            print(f"joint '{each.joint.name}': {warning}")
    save(robot, measured, options.out)
    print(f"{options.out}: {len(measured)} joints of robot '{robot.name}'")


def _find_angles(robot: Robot, posture: str) -> Array:
    """Return the joint angles of a posture by its name or file [rad], (n,)."""
    if posture == "zero":
        return np.zeros(robot.n)
    return robot.standing.joint_pos if posture == "standing" else _load(robot, posture)


def _load(robot: Robot, posture: str) -> Array:
    path = Path(posture)
    if not path.exists():
        raise BadInputError(f"unknown posture '{posture}', expected zero, standing, or a file")
    return load_posture(path, robot).joint_pos


def _make_parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m lerobot_robot_getup", description=__doc__)
    calibration = parser.add_subparsers(required=True, metavar="calibration")
    ways = calibration.add_parser("calibration").add_subparsers(required=True, metavar="WAY")
    there = ways.add_parser("to-lerobot", help="write LeRobot's file")
    there.add_argument("--robot", default="op3", help="name of a robot, or a folder")
    there.add_argument("--out", type=Path, required=True, metavar="FILE.json")
    there.set_defaults(work=convert_to_lerobot)
    back = ways.add_parser("from-lerobot", help="write calibration.toml from LeRobot's file")
    back.add_argument("file", type=Path, metavar="FILE.json")
    back.add_argument("--robot", default="op3", help="name of a robot, or a folder")
    back.add_argument("--out", type=Path, required=True, metavar="FILE.toml")
    back.add_argument(
        "--homed-at",
        default="zero",
        metavar="zero|standing|FILE",
        help="posture in which the servos were homed; default: zero, every joint at 0",
    )
    back.add_argument(
        "--directions",
        choices=("file", "robot"),
        help="whose directions to take where they differ; default: refuse",
    )
    back.set_defaults(work=convert_from_lerobot)
    return parser


if __name__ == "__main__":
    sys.exit(main())
