"""Errors of drivers and backends."""

from __future__ import annotations

from collections.abc import Sequence

from robots import Joint


class DriverError(Exception):
    """A backend failed."""


class SetupError(DriverError):
    """A setup is impossible as requested; the user must change it."""


class NotConnectedError(DriverError):
    """A backend was used before ``connect`` or after ``close``."""

    def __init__(self, backend: str) -> None:
        super().__init__(f"{backend} is not connected: call connect() or use it in a 'with' block")


class UnreleasedError(DriverError):
    """Servos that were driven do not confirm that their torque is off."""

    def __init__(self, joints: Sequence[Joint], *, watched: bool) -> None:
        names = ", ".join(f"joint '{joint.name}' (id {joint.servo.id})" for joint in joints)
        until = "" if watched else "; without a watchdog it holds its last goal until then"
        super().__init__(
            f"{names}: torque off is not confirmed: cut the supply of the servos{until}"
        )
        self.joints = tuple(joint.name for joint in joints)
        """Names of the joints."""


class NoImuError(SetupError):
    """A robot's description has no IMU."""

    def __init__(self, robot: str) -> None:
        super().__init__(
            f"robot '{robot}' has no IMU that measures how it is turned: add imu_site to its "
            "robot.toml, or play a motion with --without-imu"
        )
