"""Formats of the rows: commands to the motors, and measurements of all devices, as numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import astuple, dataclass, fields

import numpy as np

from drivers.dynamixel.control_table import OperatingMode
from drivers.virtual_bus.devices.motor_command import MotorCommand
from drivers.virtual_bus.devices.sensors import Measured
from drivers.virtual_bus.imu.reading import ImuReading
from robots.quaternion import Array

COMMAND_FIELDS, MEASURED_FIELDS = len(fields(MotorCommand)), len(Measured._fields)
BOARD_FIELDS, REST_FIELDS = 7, 12  # the rest: IMU, and by how much physics is late


def count_commands(servos: int) -> int:
    """Return the width of a row of commands."""
    return servos * (COMMAND_FIELDS + 1)


def count_measurements(servos: int) -> int:
    """Return the width of a row of measurements."""
    return servos * MEASURED_FIELDS + BOARD_FIELDS + REST_FIELDS


def write_commands(commands: Sequence[MotorCommand], profiles: Sequence[bool]) -> Array:
    """Write the motors' commands, and which servos execute a profile, as a row."""
    rows = [
        (*astuple(command), is_running)
        for command, is_running in zip(commands, profiles, strict=True)
    ]
    return np.array(rows, dtype=float).ravel()


def read_commands(row: Array) -> list[tuple[MotorCommand, bool]]:
    """Read a row of commands."""
    return [_read_command(one) for one in row.reshape(-1, COMMAND_FIELDS + 1).tolist()]


def _read_command(values: list[float]) -> tuple[MotorCommand, bool]:
    *numbers, is_running = values
    given = dict(zip((each.name for each in fields(MotorCommand)), numbers, strict=True))
    given |= {name: int(given[name]) for name in _WHOLE}
    kinds = {"torque_on": bool(given["torque_on"]), "mode": OperatingMode(int(given["mode"]))}
    return MotorCommand(**{**given, **kinds}), bool(is_running)


_WHOLE = ("p_gain", "d_gain", "velocity_p_gain", "velocity_i_gain")


@dataclass(frozen=True, eq=False)
class BodyReading:
    """Measurements of a board: supply and IMU."""

    voltage: float
    """[V]"""
    gyro: Array
    """In the axes of the robot's IMU site [rad/s], (3,)."""
    accelerometer: Array
    """[m/s²], (3,)"""


@dataclass(frozen=True, eq=False, kw_only=True)
class Measurements:
    """Measurements of all devices at one time."""

    servos: Sequence[Measured]
    board: BodyReading
    imu: ImuReading | None
    """None if the robot has no IMU on a line of its own."""
    late: float = 0.0
    """Time by which physics has fallen behind the clock since the start [s]."""

    def write(self) -> Array:
        """Write them as a row."""
        imu = np.full(REST_FIELDS - 1, np.nan)
        if self.imu is not None:
            reading = self.imu
            imu = np.r_[reading.time, reading.gyro, reading.accelerometer, reading.orientation]
        board = self.board
        servos = np.array(self.servos, dtype=float).ravel()
        return np.r_[servos, board.voltage, board.gyro, board.accelerometer, imu, self.late]

    @classmethod
    def read(cls, row: Array) -> Measurements:
        """Read them from a row."""
        servos, board, rest = np.split(row, (-BOARD_FIELDS - REST_FIELDS, -REST_FIELDS))
        measured = [Measured(*each) for each in servos.reshape(-1, MEASURED_FIELDS).tolist()]
        imu, late = rest[:-1], float(rest[-1])
        reading = None if np.isnan(imu[0]) else ImuReading(imu[0], imu[1:4], imu[4:7], imu[7:])
        body = BodyReading(float(board[0]), board[1:4], board[4:])
        return cls(servos=measured, board=body, imu=reading, late=late)
