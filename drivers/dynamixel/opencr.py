"""The OpenCR board: it switches the servos' power and carries the IMU."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from drivers.dynamixel.bus import DynamixelBus
from drivers.dynamixel.control_table import table_named
from drivers.dynamixel.diagnostics import Finding, Severity, find_far_rate
from drivers.dynamixel.protocol2 import Span, Status
from drivers.orientation_filter import ACCELEROMETER_STEP, GRAVITY, GYRO_STEP, OrientationFilter
from robots.quaternion import Array
from robots.robot import BoardSettings

TRIES = 3
IMU_BYTES = 12  # three axes of gyro and accelerometer, two bytes each
# An IMU at rest may repeat itself; one on a body whose joints move cannot, so long.
FROZEN_CYCLES = 12
MOVING = 1.0  # rad/s of the fastest joint
# A body at rest: what its IMU may show, and for how many samples.
QUIET_FORCE, QUIET_TURN, QUIET_CYCLES = 0.05, 0.2, 12  # share of gravity, rad/s
# After so long without a sample the gyro has missed too much: the vertical is taken anew.
FORGOTTEN = 1.0  # s


@dataclass(frozen=True, eq=False)
class ImuSample:
    """One look of the IMU, in the axes of the robot's IMU site."""

    gyro: Array
    """[rad/s], shape (3,)"""
    accelerometer: Array
    """[m/s²], shape (3,)"""
    counts: bytes
    """The registers it was read from."""


class OpenCr:
    """The board on the servo bus."""

    def __init__(self, bus: DynamixelBus, settings: BoardSettings) -> None:
        self.id = settings.id
        self.settings = settings
        self.bus = bus
        self._axes = np.array(settings.imu_axes, dtype=float)
        self._table = table_named(settings.model)
        self._spans = (
            self._table.span("gyro_x", "acc_z"),
            self._table.span("present_input_voltage", "acc_z"),
        )

    @property
    def model_number(self) -> int:
        """Return what the board calls itself in a ping."""
        return self._table.number

    def ping(self) -> Status | None:
        """Ask whether the board is there."""
        return self.bus.ping(self.id, TRIES)

    def power_servos(self) -> bool:
        """Switch the servos' power on; tell whether the board confirms that it is on."""
        power = self._table["dynamixel_power"]
        told = self.bus.read(self.id, power.span, TRIES)
        if told is not None and told.data == b"\x01":
            return True
        self.bus.write(self.id, power.address, b"\x01", TRIES)
        told = self.bus.read(self.id, power.span, TRIES)
        return told is not None and told.data == b"\x01"

    def answer_at_once(self) -> bool:
        """Take the board's return delay away, where it has one; tell whether it confirms."""
        delay = self._table["return_delay_time"]
        told = self.bus.read(self.id, delay.span, TRIES)
        if told is not None and told.data == b"\x00":
            return True
        done = self.bus.write(self.id, delay.address, b"\x00", TRIES)
        return done is not None and not done.number

    def span(self, cycle: int) -> Span:
        """Return the registers to read in a cycle; their length turns, so late answers show."""
        return self._spans[cycle % 2]

    def decode(self, data: bytes) -> ImuSample:
        """Convert what was read of `span` to SI, in body axes."""
        counts = data[-IMU_BYTES:]
        values = np.frombuffer(counts, "<i2")
        return ImuSample(
            gyro=self._axes * values[:3] * GYRO_STEP,
            accelerometer=self._axes * values[3:] * ACCELEROMETER_STEP,
            counts=counts,
        )

    def read_imu(self) -> ImuSample | None:
        """Take one look; ``None`` when the board is silent."""
        status = self.bus.read(self.id, self._spans[0], TRIES)
        if status is None or len(status.data) < IMU_BYTES:
            return None
        return self.decode(status.data)


class BodyImu:
    """Orientation from the board's samples, and how old it is."""

    def __init__(self, period: float) -> None:
        """Prepare for samples that come about every ``period`` seconds."""
        self._filter = OrientationFilter(period)
        self._counts = b""
        self._repeats = 0
        self.gyro = np.zeros(3)
        """Angular velocity in the IMU frame [rad/s], shape (3,)."""
        self.stamp = -np.inf
        """When the newest sample was taken [s]."""
        self._changed = -np.inf
        self._is_settled = True
        self._quiet = 0

    @property
    def orientation(self) -> Array:
        """Return the estimate, IMU frame to world, w x y z."""
        return self._filter.orientation

    def start(self, sample: ImuSample, now: float) -> None:
        """Begin at rest; when the body moves, the vertical is taken anew as soon as it rests."""
        self._is_settled, self._quiet = _is_quiet(sample), 0
        self._filter.start(sample.accelerometer)
        self.gyro, self.stamp = sample.gyro, now
        self._counts, self._changed, self._repeats = sample.counts, now, 0

    def take(self, sample: ImuSample, now: float, speed: float) -> None:
        """Advance the estimate by a sample.

        Args:
            sample: What the board tells.
            now: When [s].
            speed: Of the fastest joint [rad/s]. A body whose joints move shakes its IMU: one
                that repeats itself then is broken, and its samples count as not taken.
        """
        if sample.counts != self._counts:
            self._counts, self._changed, self._repeats = sample.counts, now, 0
        elif speed > MOVING:
            self._repeats += 1
        if self._repeats >= FROZEN_CYCLES:
            self.stamp = min(self.stamp, self._changed)
            return
        period = now - self.stamp
        if not self._is_settled:
            self._quiet = self._quiet + 1 if _is_quiet(sample) else 0
            self._is_settled = self._quiet >= QUIET_CYCLES
        if period > FORGOTTEN or self._quiet >= QUIET_CYCLES:
            self._quiet = 0
            self._filter.start(sample.accelerometer)
        elif period > 0.0:
            self._filter.update(sample.gyro, sample.accelerometer, period)
        self.gyro, self.stamp = sample.gyro, now


def _is_quiet(sample: ImuSample) -> bool:
    force = float(np.sqrt(sample.accelerometer @ sample.accelerometer))
    turn = float(np.sqrt(sample.gyro @ sample.gyro))
    return abs(force / GRAVITY - 1.0) < QUIET_FORCE and turn < QUIET_TURN


def check_board(board: OpenCr) -> list[Finding]:
    """Look whether the board is there, and switch the servos' power on."""
    status = board.ping()
    if status is None:
        rate = find_far_rate(board.bus, [board.id])
        if rate is None:
            return [blame_board(board.settings, "silent")]
        text = f"talks at {rate} bit/s, not {board.bus.port.baud}"
        remedy = "set bus.baud in robot.toml, or the baud rates of board and servos"
        return [replace(blame_board(board.settings, text), remedy=remedy)]
    number = int.from_bytes(status.data[:2], "little")
    if number != board.model_number:
        return [blame_board(board.settings, f"is of model {number}")]
    if not board.answer_at_once():
        return [blame_board(board.settings, "does not take a return delay of 0")]
    if board.settings.powers_servos and not board.power_servos():
        return [blame_board(board.settings, "does not switch the servos' power on")]
    return []


def blame_board(board: BoardSettings, text: str) -> Finding:
    """Build the finding that something is wrong with the board."""
    name = f"board '{board.model}' (id {board.id})"
    return Finding(Severity.ERROR, name, text, "check its power, its cable and bus.board")
