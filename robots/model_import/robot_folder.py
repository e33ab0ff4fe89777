"""The folder of an imported robot: model.xml, robot.toml with its guesses marked, servos.toml."""

from __future__ import annotations

import os
from pathlib import Path

import tomlkit

from robots.description.loading import load_robot
from robots.model_import.importer import ImportedRobot
from robots.model_import.rebuilt import IMU, NECK, SOLES
from robots.model_import.source import Fold, ModelImportError
from robots.robot import RobotError
from robots.servo import TICKS_PER_TURN
from robots.storage.files import atomic_folder, describe
from robots.storage.toml_document import Value, commented, one_a_line, rounded, table_of, tables_of

CONTROL_PERIOD = 0.008  # s
MOST_SERVOS = 24  # that one bus of 2 Mbit/s reads and writes in that time
LONGER_PERIOD = 0.012  # s
LEAST_ANGLE = 5e-5  # rad, written as 0
BAUD = 1_000_000
GUESSES = "ids, signs and zeros of the servos, the baud rate, the control period"
RISING_COMMENT = "Joints that a learned rise moves, one of each pair, and those that spread limbs."
IDS_COMMENT = "id, sign and zero_ticks are guessed: `getup servo list`, then `getup calibrate`."
COUPLING_COMMENT = "turns of each servo (rows) per turn of each joint (columns)"
SERVOS_COMMENTS = (
    "Motors that the package does not know. Torque and speed are the model's; the rest is",
    "scaled from the XM540-W270 by the torque: replace it by what you know.",
)


def write_robot(robot: ImportedRobot, folder: Path) -> None:
    """Write a robot's folder, which must not exist or be empty: one that loads, or none."""
    try:
        wrong = "not empty" if folder.exists() and any(folder.iterdir()) else ""
        wrong = wrong or ("a symbolic link" if folder.is_symlink() else "")
        if wrong:
            raise ModelImportError(f"--out is {folder}, which is {wrong}, expected a new folder")
        with atomic_folder(folder) as partial:
            (partial / "model.xml").write_text(robot.spec.to_xml(), "utf-8")
            (partial / "robot.toml").write_text(describe_robot(robot), "utf-8")
            if robot.servos.own:
                (partial / "servos.toml").write_text(describe_servos(robot), "utf-8")
            load_robot(partial)
    except RobotError as error:
        raise ModelImportError(
            *(problem.replace(f"{partial}{os.sep}", "") for problem in error.problems)
        ) from error
    except OSError as error:
        reason = f"--out is {folder}: {describe(error)}, expected a new folder"
        raise ModelImportError(reason) from error


def describe_robot(robot: ImportedRobot) -> str:
    """Write the robot.toml of an imported robot."""
    period = CONTROL_PERIOD if len(robot.joints) <= MOST_SERVOS else LONGER_PERIOD
    document = tomlkit.document()
    comments = [f"{robot.options.name}: imported by `getup robots import`. What was guessed:"]
    comments += [f"- {' '.join(line.split())}" for line in (*robot.guesses, GUESSES)]
    for comment in comments:
        document.add(tomlkit.comment(comment))
    document.add(tomlkit.nl())
    document.add("name", tomlkit.item(robot.options.name))
    document.add("model", tomlkit.item("model.xml"))
    document.add("torso", tomlkit.item(robot.torso))
    document.add("neck_site", commented(NECK, "guessed"))
    document.add("imu_site", commented(IMU, "guessed"))
    document.add("sole_sites", tomlkit.item(list(SOLES)))
    document.add("control_period", commented(period, "s; guessed"))
    document.add("supply_voltage", commented(robot.servos.supply, "V; guessed"))
    document.add(tomlkit.comment(RISING_COMMENT))
    document.add("rising_joints", tomlkit.item(list(robot.rising_joints)))
    document.add("spreading_joints", tomlkit.item(list(robot.spreading_joints)))
    if robot.passive_joints:
        document.add("passive_joints", tomlkit.item(list(robot.passive_joints)))
    document.add(tomlkit.nl())
    document.add(tomlkit.comment(IDS_COMMENT))
    rows = [_describe_joint(robot, number) for number in range(len(robot.joints))]
    document.add("joints", one_a_line(rows, in_columns=True))
    angles = zip(robot.joints, robot.stance.joint_pos.tolist(), strict=True)
    standing = {name: round(angle, 4) for name, angle in angles if abs(angle) > LEAST_ANGLE}
    document.add("standing", table_of(standing, "Found by balancing on flat soles [rad]."))
    couplings = [fold for fold in robot.folds if len(fold.joints) > 1]
    if couplings:
        document.add("couplings", tables_of(map(_describe_coupling, couplings)))
    bus = table_of({})
    bus.add("baud", commented(BAUD, "guessed: `getup servo list` tells"))
    document.add("bus", bus)
    return document.as_string()


def _describe_joint(robot: ImportedRobot, number: int) -> dict[str, Value]:
    name = robot.joints[number]
    gear = next((f.gear for f in robot.folds if f.joints == (name,)), 1.0)
    row: dict[str, Value] = {
        "name": name,
        "id": number + 1,
        "servo": robot.servos.types[number],
        "sign": 1 if gear > 0.0 else -1,
    }
    if abs(gear) != 1.0:
        row["gear"] = rounded(abs(gear), 5)
    return row | {
        "zero_ticks": TICKS_PER_TURN // 2,
        "mirror": robot.joints[robot.mirror[number]],
        "mirror_sign": robot.mirror_sign[number],
        "segment": robot.segments[number],
    }


def _describe_coupling(fold: Fold) -> dict[str, Value]:
    """Describe two joints that two servos turn: turns of each servo per turn of each joint."""
    matrix = [[rounded(turns, 5) for turns in row] for row in fold.matrix.tolist()]
    return {"joints": list(fold.joints), "matrix": commented(matrix, COUPLING_COMMENT)}


def describe_servos(robot: ImportedRobot) -> str:
    """Write the servos.toml of an imported robot: motors that are not Dynamixels."""
    document = tomlkit.document()
    for comment in SERVOS_COMMENTS:
        document.add(tomlkit.comment(comment))
    for name, figures in robot.servos.own.items():
        document.add(name, table_of({key: rounded(x, 6) for key, x in figures.items()}))
    return document.as_string()
