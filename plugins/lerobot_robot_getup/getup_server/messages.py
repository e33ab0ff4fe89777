"""Messages between LeRobot's process and that of the robot, which are pickled."""

from __future__ import annotations

from dataclasses import dataclass

from getup_server.robot_request import RobotRequest
from robots.quaternion import Array


@dataclass(frozen=True, kw_only=True)
class Setup:
    """A robot, and how it follows actions."""

    request: RobotRequest
    rises: bool
    """Whether it gets up after a fall."""
    realtime: bool
    """Whether the cycles of a simulated robot keep the pace of the wall clock."""
    max_speed: float
    """Of the targets of actions; infinity for that of the servos [rad/s]."""
    approach_speed: float
    """To the first action after the start or a rise [rad/s]."""
    fallen_tilt: float
    """Tilt of the torso from which it counts as fallen [rad]."""


@dataclass(frozen=True, kw_only=True)
class Act:
    """Move joints to targets; the others keep theirs."""

    targets: dict[str, float]
    """Target angles by the names of joints [rad]."""


@dataclass(frozen=True)
class Observe:
    """Return what is known of the robot."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Snapshot:
    """What is known of the robot; the reply to every message."""

    joint_pos: Array
    """Measured joint angles [rad], (n,)."""
    targets: Array
    """Targets as sent to the servos; the measured angles of joints without torque [rad], (n,)."""
    gravity_b: Array
    """Direction of gravity in the torso, (3,); (0,) without an IMU."""
    gyro_b: Array
    """Angular velocity of the torso in its own frame [rad/s], (3,); (0,) without an IMU."""
    rising: bool = False
    """Whether it has fallen and does not obey until it stands."""
    phase: str = ""
    """What it does, in a few words."""
    ended: str = ""
    """Why torque went off, for good; empty while the robot can move."""


@dataclass(frozen=True)
class Refusal:
    """Why the robot cannot be opened: the reply instead of the first snapshot."""

    reason: str
