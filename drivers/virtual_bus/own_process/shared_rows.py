"""Rows of numbers that one process publishes and another one reads, without a lock.

They hold the commands to the motors, or the measurements of all devices.
"""

from __future__ import annotations

import mmap
import os
from collections.abc import Sequence
from dataclasses import astuple, dataclass, fields

import numpy as np

from drivers.virtual_bus.devices.motor_servo import MotorCommand
from drivers.virtual_bus.devices.sensors import Measured
from drivers.virtual_bus.imu.virtual_imu import ImuReading
from robots.quaternion import Array

SLOTS = 8
"""Rows that are kept, so that a reader has the time of seven to copy one."""
WORD = 8  # bytes of a number
COMMAND_FIELDS, MEASURED_FIELDS = len(fields(MotorCommand)), len(Measured._fields)
BOARD_FIELDS, IMU_FIELDS = 7, 11


class SharedRows:
    """The newest of the rows that one process writes; neither side ever waits for the other."""

    def __init__(self, width: int, descriptor: int | None = None) -> None:
        """Create rows of some numbers, or open those of another process by their descriptor."""
        self.descriptor = os.memfd_create("rows") if descriptor is None else descriptor
        """File descriptor, for the other process."""
        size = WORD * (1 + SLOTS * (width + 1))
        if descriptor is None:
            os.ftruncate(self.descriptor, size)
        self._memory = mmap.mmap(self.descriptor, size)
        self._count = np.frombuffer(self._memory, dtype=np.int64, count=1)
        rows = np.frombuffer(self._memory, dtype=float, offset=WORD)
        self._rows = rows.reshape(SLOTS, width + 1)  # each begins with its number

    def publish(self, row: Array) -> None:
        """Publish a row, (width,)."""
        number = int(self._count[0]) + 1
        slot = self._rows[number % SLOTS]
        slot[0] = -1.0  # not to be read until it is complete
        slot[1:] = row
        slot[0] = number
        self._count[0] = number

    def read(self, after: int) -> tuple[int, Array] | None:
        """Return number and values of the newest row; None if none came after a number."""
        while (number := int(self._count[0])) > after:
            slot = self._rows[number % SLOTS].copy()
            if slot[0] == number and int(self._count[0]) - number < SLOTS - 1:
                return number, slot[1:]
        return None

    def close(self) -> None:
        """Close the descriptor; the memory goes with the last process that has it."""
        os.close(self.descriptor)


def count_commands(servos: int) -> int:
    """Return the width of a row of commands."""
    return servos * (COMMAND_FIELDS + 1)


def count_measurements(servos: int) -> int:
    """Return the width of a row of measurements."""
    return servos * MEASURED_FIELDS + BOARD_FIELDS + IMU_FIELDS


def write_commands(commands: Sequence[MotorCommand], profiles: Sequence[bool]) -> Array:
    """Write the motors' commands, and which servos execute a profile, as a row."""
    rows = [
        (*astuple(command), is_running)
        for command, is_running in zip(commands, profiles, strict=True)
    ]
    return np.array(rows, dtype=float).ravel()


def read_commands(row: Array) -> list[tuple[MotorCommand, bool]]:
    """Read a row of commands."""
    found = []
    for on, by_current, target, p, d, *limits, runs in row.reshape(-1, COMMAND_FIELDS + 1).tolist():
        command = MotorCommand(bool(on), bool(by_current), target, int(p), int(d), *limits)
        found.append((command, bool(runs)))
    return found


@dataclass(frozen=True, eq=False, kw_only=True)
class Measurements:
    """Measurements of all devices at one time."""

    servos: Sequence[Measured]
    voltage: float
    """Supply at the board [V]."""
    gyro: Array
    """Of the board, in the axes of the robot's IMU site [rad/s], (3,)."""
    accelerometer: Array
    """Likewise [m/s²], (3,)."""
    imu: ImuReading | None
    """None if the robot has no IMU on a line of its own."""

    def write(self) -> Array:
        """Write them as a row."""
        imu = np.full(IMU_FIELDS, np.nan)
        if self.imu is not None:
            reading = self.imu
            imu = np.r_[reading.time, reading.gyro, reading.accelerometer, reading.orientation]
        servos = np.array(self.servos, dtype=float).ravel()
        return np.r_[servos, self.voltage, self.gyro, self.accelerometer, imu]

    @classmethod
    def read(cls, row: Array) -> Measurements:
        """Read them from a row."""
        servos, board, imu = np.split(row, (-BOARD_FIELDS - IMU_FIELDS, -IMU_FIELDS))
        measured = [Measured(*each) for each in servos.reshape(-1, MEASURED_FIELDS).tolist()]
        reading = None if np.isnan(imu[0]) else ImuReading(imu[0], imu[1:4], imu[4:7], imu[7:])
        body = {"voltage": float(board[0]), "gyro": board[1:4], "accelerometer": board[4:]}
        return cls(servos=measured, imu=reading, **body)
