"""Calibration: measured zero and direction of each servo."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tomlkit
from msgspec import Meta

from robots.servo import MAX_TICKS
from robots.storage.files import write_atomically
from robots.storage.toml_document import table_of
from robots.storage.validation import Sign, name_unknown_joints, read_toml, reading, shown, whole

if TYPE_CHECKING:
    from robots.robot import Robot

CALIBRATION_FILE = "calibration.toml"


class CalibrationError(ValueError):
    """A calibration file cannot be used."""


@dataclass(frozen=True)
class JointCalibration:
    """Measured zero and direction of one joint."""

    zero_ticks: Annotated[int, whole(-MAX_TICKS, MAX_TICKS)]
    """Ticks at joint angle 0."""
    sign: Sign
    """+1 when more ticks turn the joint in its positive direction, else -1."""


@dataclass(frozen=True, kw_only=True)
class Calibration:
    """Measured zeros and directions of a robot; they replace those of its description."""

    robot: str
    joints: Annotated[dict[str, JointCalibration], Meta(description="a table of joint names")] = (
        field(default_factory=dict)
    )

    def apply(self, robot: Robot) -> Robot:
        """Return the robot with the measured zeros and directions."""
        joints = (
            replace(joint, servo=replace(joint.servo, **asdict(self.joints[joint.name])))
            if joint.name in self.joints
            else joint
            for joint in robot.joints
        )
        return replace(robot, joints=tuple(joints))

    def save(self, path: Path) -> None:
        """Write the file."""
        document = tomlkit.document()
        document.add(tomlkit.comment("Servos as measured by `getup calibrate`."))
        document.add("robot", tomlkit.item(self.robot))
        joints = tomlkit.table(is_super_table=True)
        for name, found in self.joints.items():
            joints.add(name, table_of(asdict(found)))
        document.add("joints", joints)
        write_atomically(path, document.as_string())

    @classmethod
    def load(cls, path: Path, robot: Robot) -> Calibration:
        """Load a robot's calibration; the error names all that is wrong."""
        advice = " (make a new one: getup calibrate)"
        with reading(f"calibration file {path}", CalibrationError, advice) as problems:
            calibration = read_toml(cls, path, problems, is_strict=False)
            if calibration.robot not in ("", robot.name):
                problems.append(
                    f"it is of robot {shown(calibration.robot)}, expected {shown(robot.name)}"
                )
            unknown = [name for name in calibration.joints if name not in robot.joint_names]
            problems += name_unknown_joints(unknown, robot.joint_names)
            return calibration
