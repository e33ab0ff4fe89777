"""Calibration: where each servo's zero really is, and which way it turns."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from robots.files import write_atomically
from robots.schema import Fields
from robots.validation import shown

if TYPE_CHECKING:
    from robots.robot import Robot

CALIBRATION_FILE = "calibration.toml"
MAX_TICKS = 1_048_575  # either way, the servos' extended position range (e-manual)


class CalibrationError(ValueError):
    """A calibration file cannot be used."""


@dataclass(frozen=True)
class JointCalibration:
    """What was found of one joint."""

    zero_ticks: int
    """Ticks at joint angle 0."""
    sign: int
    """+1 when more ticks turn the joint in its positive direction, else -1."""


@dataclass(frozen=True, kw_only=True)
class Calibration:
    """What was found of a robot's joints; it replaces what the description says of them."""

    robot: str
    joints: dict[str, JointCalibration]

    def apply(self, robot: Robot) -> Robot:
        """Return the robot with its servos as they were found."""
        joints = tuple(
            replace(
                joint,
                servo=replace(
                    joint.servo,
                    zero_ticks=self.joints[joint.name].zero_ticks,
                    sign=self.joints[joint.name].sign,
                ),
            )
            if joint.name in self.joints
            else joint
            for joint in robot.joints
        )
        return replace(robot, joints=joints)

    def save(self, path: Path) -> None:
        """Write the file; a reader never sees half of it."""
        lines = ["# Servos as found by `getup calibrate`.", f'robot = "{self.robot}"', ""]
        for name, found in self.joints.items():
            lines += [f"[joints.{name}]", f"zero_ticks = {found.zero_ticks}"]
            lines += [f"sign = {found.sign}", ""]
        write_atomically(path, "\n".join(lines))

    @classmethod
    def load(cls, path: Path, robot: Robot) -> Calibration:
        """Load a robot's calibration.

        Raises:
            CalibrationError: naming all that is wrong, another robot's file above all.
        """
        try:
            table = tomllib.loads(path.read_text("utf-8"))
        except OSError as error:
            raise CalibrationError(f"calibration file {path}: {error.strerror}") from error
        except ValueError as error:
            told = " ".join(str(error).split())
            raise CalibrationError(f"calibration file {path}: not TOML ({told})") from error
        faults: list[str] = []
        name = Fields(table, "", faults).text("robot")
        if name and name != robot.name:
            faults.append(f"it is of robot {shown(name)}, allowed {shown(robot.name)}")
        joints = _read_joints(table.get("joints", {}), robot.joint_names, faults)
        if faults:
            raise CalibrationError(
                f"calibration file {path}: {'; '.join(faults)} (make it anew: getup calibrate)"
            )
        return cls(robot=name, joints=joints)


def _read_joints(
    tables: Any, names: tuple[str, ...], faults: list[str]
) -> dict[str, JointCalibration]:
    if not isinstance(tables, dict):
        faults.append(f"joints is {shown(tables)}, allowed a table of joint names")
        return {}
    joints = {}
    for name, table in tables.items():
        if name not in names:
            faults.append(f"unknown joint {shown(name)}")
        elif not isinstance(table, dict):
            faults.append(f"joint {shown(name)} is {shown(table)}, allowed a table")
        else:
            fields = Fields(table, f"joint {shown(name)}: ", faults)
            zero = fields.integer("zero_ticks", -MAX_TICKS, MAX_TICKS)
            joints[name] = JointCalibration(zero, fields.sign("sign"))
    return joints
