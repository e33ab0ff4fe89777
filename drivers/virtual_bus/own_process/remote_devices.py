"""The side of the physics: motors and sensors of devices that are in another process."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from drivers.virtual_bus.devices.motor_servo import MotorCommand
from drivers.virtual_bus.devices.sensors import Measured
from drivers.virtual_bus.imu.virtual_imu import ImuReading
from drivers.virtual_bus.own_process.shared_rows import (
    Measurements,
    SharedRows,
    count_commands,
    count_measurements,
    read_commands,
)
from robots.quaternion import Array


class RemoteServo:
    """Motor and sensors of a servo."""

    def __init__(self, servo_id: int) -> None:
        self.id = servo_id
        self.measured = Measured()
        self.has_profile = False
        self._command = MotorCommand()  # as long as it has sent none

    def motor_command(self) -> MotorCommand:
        """Return its newest command."""
        return self._command

    def receive(self, command: MotorCommand, has_profile: bool) -> None:
        """Take the newest command; an equal one stays the same object."""
        self.has_profile = has_profile
        if command != self._command:
            self._command = command

    def sense(self, measured: Measured) -> None:
        """Measure."""
        self.measured = measured

    def advance(self, now: float) -> None:
        """Do nothing: its clock is in the other process."""


class RemoteBoard:
    """Sensors of a board."""

    def __init__(self) -> None:
        self.voltage, self.gyro, self.accelerometer = 0.0, np.zeros(3), np.zeros(3)

    def sense_voltage(self, voltage: float) -> None:
        """Measure the supply [V]."""
        self.voltage = voltage

    def sense_body(self, gyro: Array, accelerometer: Array) -> None:
        """Measure rates [rad/s] and forces [m/s²], (3,) each."""
        self.gyro, self.accelerometer = gyro, accelerometer

    def advance(self, now: float) -> None:
        """Do nothing: its clock is in the other process."""


class RemoteDevices:
    """All devices of a robot, and the rows to and from them."""

    def __init__(self, ids: Sequence[int]) -> None:
        """Begin without torque."""
        n = len(ids)
        self.servos = [RemoteServo(each) for each in ids]
        self.board = RemoteBoard()
        self.imu: ImuReading | None = None
        """What an IMU on a line of its own measured last; None without one."""
        self.late = 0.0
        """Time by which physics has fallen behind the clock since the start [s]."""
        self.commands = SharedRows(count_commands(n))
        self.measurements = SharedRows(count_measurements(n))
        self._read = 0

    def receive(self) -> None:
        """Take the newest commands."""
        row = self.commands.read(after=self._read)
        if row is None:
            return
        self._read = row[0]
        for servo, (command, has_profile) in zip(self.servos, read_commands(row[1]), strict=True):
            servo.receive(command, has_profile)

    def publish(self) -> None:
        """Publish the newest measurements."""
        found = Measurements(
            servos=[servo.measured for servo in self.servos],
            **vars(self.board),
            imu=self.imu,
            late=self.late,
        )
        self.measurements.publish(found.write())

    def close(self) -> None:
        """Close the descriptors."""
        self.commands.close()
        self.measurements.close()
