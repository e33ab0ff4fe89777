"""The OpenCR board: it switches the servos' power and carries the IMU."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from drivers.dynamixel.bus import TRIES, DynamixelBus
from drivers.dynamixel.control_table import table_named
from drivers.dynamixel.diagnostics import Finding, find_baud_rate
from drivers.dynamixel.protocol2 import Span
from drivers.orientation_filter import ACCELEROMETER_STEP, GRAVITY, GYRO_STEP, OrientationFilter
from robots.quaternion import Array
from robots.robot import BoardSettings

IMU_BYTES = 12  # three axes of gyro and accelerometer, two bytes each
# An IMU at rest may repeat a sample; one on a body whose joints move cannot, for so long.
FROZEN_CYCLES = 12
MOVING = 1.0  # rad/s of the fastest joint
# A body at rest: bounds of its IMU samples, and their number.
QUIET_FORCE, QUIET_TURN, QUIET_CYCLES = 0.05, 0.2, 12  # share of gravity, rad/s
# After so long without a sample the gyro has missed too much: the vertical is measured again.
MAX_GAP = 1.0  # s


@dataclass(frozen=True, eq=False)
class ImuSample:
    """One sample of the IMU, in the axes of the robot's IMU site."""

    gyro: Array
    """[rad/s], shape (3,)"""
    accelerometer: Array
    """[m/s²], shape (3,)"""
    counts: bytes
    """Registers that it was read from."""


class OpenCr:
    """The controller board on the servo bus."""

    def __init__(self, bus: DynamixelBus, settings: BoardSettings) -> None:
        self.id = settings.id
        self.settings = settings
        self.bus = bus
        self._axes = np.array(settings.imu_axes, dtype=float)
        self.table = table_named(settings.model)
        self._spans = (
            self.table.span("gyro_x", "acc_z"),
            self.table.span("present_input_voltage", "acc_z"),
        )

    @property
    def name(self) -> str:
        """Return its name in messages."""
        return f"board '{self.settings.model}' (id {self.id})"

    def finding(
        self, text: str, remedy: str = "check its power, its cable and bus.board"
    ) -> Finding:
        """Build a finding about the board."""
        return Finding.error(self.name, text, remedy)

    def is_powering(self) -> bool:
        """Return whether the servos' power is on."""
        return self.bus.read_item(self.id, self.table["dynamixel_power"]) == 1

    def span(self, cycle: int) -> Span:
        """Return the registers to read in a cycle; their length alternates against late replies."""
        return self._spans[cycle % 2]

    def decode(self, data: bytes) -> ImuSample:
        """Convert the registers of `span` to SI, in body axes."""
        counts = data[-IMU_BYTES:]
        values = np.frombuffer(counts, "<i2")
        return ImuSample(
            gyro=self._axes * values[:3] * GYRO_STEP,
            accelerometer=self._axes * values[3:] * ACCELEROMETER_STEP,
            counts=counts,
        )

    def read_imu(self) -> ImuSample | None:
        """Read one sample; ``None`` if the board is silent."""
        status = self.bus.read(self.id, self._spans[0], TRIES)
        if status is None or len(status.data) < IMU_BYTES:
            return None
        return self.decode(status.data)


class ImuFusion:
    """Estimates the orientation from the board's samples, and how old it is."""

    def __init__(self, period: float) -> None:
        """Prepare for samples that come about every ``period`` seconds."""
        self._filter = OrientationFilter(period)
        self._counts = b""
        self._repeats = 0
        self.gyro = np.zeros(3)
        """Angular velocity in the IMU frame [rad/s], shape (3,)."""
        self.stamp = -np.inf
        """Time of the newest sample [s]."""
        self._changed = -np.inf
        self._is_settled = True
        self._quiet = 0

    @property
    def orientation(self) -> Array:
        """Return the estimate, IMU frame to world, w x y z."""
        return self._filter.orientation

    def start(self, sample: ImuSample, now: float) -> None:
        """Begin at rest; if the body moves, the vertical is measured again as soon as it rests."""
        self._is_settled, self._quiet = _is_quiet(sample), 0
        self._filter.start(sample.accelerometer)
        self.gyro, self.stamp = sample.gyro, now
        self._counts, self._changed, self._repeats = sample.counts, now, 0

    def update(self, sample: ImuSample, now: float, speed: float) -> None:
        """Advance the estimate by a sample.

        Args:
            sample: Newest sample.
            now: Its time [s].
            speed: Of the fastest joint [rad/s]. A body whose joints move shakes its IMU: one
                that repeats a sample then is broken, and the sample does not count.
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
        if period > MAX_GAP or self._quiet >= QUIET_CYCLES:
            self._quiet = 0
            self._filter.start(sample.accelerometer)
        elif period > 0.0:
            self._filter.update(sample.gyro, sample.accelerometer, period)
        self.gyro, self.stamp = sample.gyro, now


def _is_quiet(sample: ImuSample) -> bool:
    force = float(np.sqrt(sample.accelerometer @ sample.accelerometer))
    turn = float(np.sqrt(sample.gyro @ sample.gyro))
    return abs(force / GRAVITY - 1.0) < QUIET_FORCE and turn < QUIET_TURN


def check_board(board: OpenCr, *, set_delay: bool = True) -> list[Finding]:
    """Check that the board replies, set its return delay to 0, and switch the servos on."""
    status = board.bus.ping(board.id, TRIES)
    if status is None:
        rate = find_baud_rate(board.bus, [board.id])
        if rate is None:
            return [board.finding("silent")]
        text = f"uses {rate} bit/s, expected {board.bus.port.baud}"
        remedy = "set bus.baud in robot.toml, or the baud rates of board and servos"
        return [board.finding(text, remedy)]
    number = int.from_bytes(status.data[:2], "little")
    if number != board.table.number:
        return [board.finding(f"is of model {number}, expected {board.table.number}")]
    delay, bus = board.table["return_delay_time"], board.bus
    must_set = set_delay and bus.read_item(board.id, delay) != 0
    if must_set and not bus.write_item(board.id, delay, 0):
        return [board.finding("does not accept a return delay of 0")]
    if board.settings.powers_servos and not board.is_powering():
        bus.write_item(board.id, board.table["dynamixel_power"], 1)
        if not board.is_powering():
            return [board.finding("does not switch the servos' power on")]
    return []
