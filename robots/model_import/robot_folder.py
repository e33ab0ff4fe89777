"""The folder of an imported robot: model.xml, robot.toml with its guesses marked, servos.toml."""

from __future__ import annotations

import os
import shutil
import tempfile
from pathlib import Path

from robots.model_import.importer import ImportedRobot
from robots.model_import.sites import IMU, NECK, SOLES
from robots.model_import.source import ModelImportError
from robots.servo import TICKS_PER_TURN

CONTROL_PERIOD = 0.008  # s
MOST_SERVOS = 24  # that one bus of 2 Mbit/s reads and writes in that time
LONGER_PERIOD = 0.012  # s
LEAST_ANGLE = 5e-5  # rad, written as 0
BAUD = 1_000_000


def write_robot(robot: ImportedRobot, folder: Path) -> None:
    """Write a robot's folder, which must not exist or be empty; complete or not at all.

    Raises:
        ModelImportError: if the folder is not empty or cannot be written.
    """
    try:
        if folder.exists() and any(folder.iterdir()):
            raise ModelImportError(
                [f"--out is {folder}, which is not empty, expected a new folder"]
            )
        folder.parent.mkdir(parents=True, exist_ok=True)
        partial = Path(tempfile.mkdtemp(prefix=".getup-", dir=folder.parent))
    except OSError as error:
        raise ModelImportError(
            [f"--out is {folder}: {error.strerror}, expected a new folder"]
        ) from error
    try:
        partial.chmod(0o777 & ~_umask())
        (partial / "model.xml").write_text(robot.spec.to_xml(), "utf-8")
        (partial / "robot.toml").write_text(describe(robot), "utf-8")
        if robot.servos.own:
            (partial / "servos.toml").write_text(describe_servos(robot), "utf-8")
        if folder.exists():
            folder.rmdir()
        partial.replace(folder)
    finally:
        shutil.rmtree(partial, ignore_errors=True)


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


def describe(robot: ImportedRobot) -> str:
    """Write the robot.toml of an imported robot."""
    period = CONTROL_PERIOD if len(robot.joints) <= MOST_SERVOS else LONGER_PERIOD
    head = [
        f"# {robot.options.name}: imported by `getup robots import`. What was guessed:",
        *[f"# - {line}" for line in _wrap(_list_guesses(robot))],
        "",
        f"name = {_text(robot.options.name)}",
        'model = "model.xml"',
        f"torso = {_text(robot.torso)}",
        f"neck_site = {_text(NECK)}  # guessed",
        f"imu_site = {_text(IMU)}  # guessed",
        f"sole_sites = [{', '.join(map(_text, SOLES))}]",
        f"control_period = {period:g}  # s; guessed",
        f"supply_voltage = {robot.servos.supply:g}  # V; guessed",
        "# Joints that a learned rise moves, one of each pair, and those that spread limbs.",
        f"rising_joints = [{', '.join(map(_text, robot.rising_joints))}]",
        f"spreading_joints = [{', '.join(map(_text, robot.spreading_joints))}]",
        "",
        "# id, sign and zero_ticks are guessed: `getup scan`, then `getup calibrate`.",
        "joints = [",
    ]
    width = max(len(name) for name in robot.joints) + 3
    kind = max(len(name) for name in robot.servos.types) + 3
    rows = [
        f"  {{ name = {_text(name) + ',':{width}} id = {k + 1}, "
        f"servo = {_text(robot.servos.types[k]) + ',':{kind}} {_turning(robot, name)}"
        f"zero_ticks = {TICKS_PER_TURN // 2}, mirror = {_text(robot.joints[robot.mirror[k]])}, "
        f"mirror_sign = {robot.mirror_sign[k]}, segment = {_text(robot.segments[k])} }},"
        for k, name in enumerate(robot.joints)
    ]
    standing = [
        f"{_key(name)} = {angle:.4f}"
        for name, angle in zip(robot.joints, robot.stance.joint_pos, strict=True)
        if abs(angle) > LEAST_ANGLE
    ]
    bus = ["", "[bus]", f"baud = {BAUD:_}  # guessed: `getup scan` tells"]
    return "\n".join(
        [
            *head,
            *rows,
            "]",
            "",
            "# Found by balancing on flat soles [rad].",
            "[standing]",
            *standing,
            *_list_couplings(robot),
            *bus,
            "",
        ]
    )


def _turning(robot: ImportedRobot, joint: str) -> str:
    """Write the sign of a joint, and its gear if it has one."""
    gear = next((f.gear for f in robot.folds if f.joints == (joint,)), 1.0)
    sign = "1" if gear > 0.0 else "-1"
    return f"sign = {sign}, " + (f"gear = {abs(gear):.5g}, " if abs(gear) != 1.0 else "")


def _list_couplings(robot: ImportedRobot) -> list[str]:
    return [
        line
        for fold in robot.folds
        if len(fold.joints) > 1
        for line in (
            "",
            "[[couplings]]",
            f"joints = [{', '.join(map(_text, fold.joints))}]",
            "# Turns of each servo (rows) per turn of each joint (columns).",
            f"matrix = {[[float(f'{turns:.5g}') for turns in row] for row in fold.matrix]}",
        )
    ]


def _list_guesses(robot: ImportedRobot) -> list[str]:
    return [
        *robot.guesses,
        "ids, signs and zeros of the servos, the baud rate, the control period",
    ]


def describe_servos(robot: ImportedRobot) -> str:
    """Write the servos.toml of an imported robot: motors that are not Dynamixels."""
    lines = [
        "# Motors that the package does not know. Torque and speed are the model's; the rest is",
        "# scaled from the XM540-W270 by the torque: replace it by what you know.",
    ]
    for name, figures in robot.servos.own.items():
        lines += ["", f"[{_text(name)}]", *[f"{key} = {value:g}" for key, value in figures.items()]]
    return "\n".join([*lines, ""])


def _text(value: str) -> str:
    escaped = value.replace("\\", "\\\\").replace('"', '\\"')
    return f'"{escaped}"'


def _key(name: str) -> str:
    return name if name.replace("-", "_").isidentifier() and name.isascii() else _text(name)


def _wrap(lines: list[str]) -> list[str]:
    return [" ".join(line.split()) for line in lines]
