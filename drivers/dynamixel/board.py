"""A controller board on the servo bus: it carries the IMU and may switch the servos' power."""

from __future__ import annotations

import numpy as np

from drivers.dynamixel.bus import TRIES, DynamixelBus
from drivers.dynamixel.control_table import table_named
from drivers.dynamixel.diagnostics import Finding, find_baud_rate
from drivers.dynamixel.protocol2 import Span, read_identity
from drivers.imu.fusion import ACCELEROMETER_STEP, GYRO_STEP
from drivers.imu.source import ImuError, ImuSample, ImuSource
from robots.bus_settings import BoardSettings
from robots.imu import SensorAxes

AXES_BYTES = 6  # three axes, two bytes each
REMEDY = "check its power, its cable and bus.board"


class Board(ImuSource):
    """The controller board on a servo bus, an `ImuSource`.

    Its control table is that of a known model, or robot.toml gives the addresses and scales of
    gyro and accelerometer. Its registers are read with those of the servos, in the same request:
    `receive` takes them.
    """

    def __init__(
        self, bus: DynamixelBus, settings: BoardSettings, *, carries_imu: bool = True
    ) -> None:
        self.id, self.carries_imu = settings.id, carries_imu
        self.settings = settings
        self.bus = bus
        self.table = table_named(settings.model) if settings.model else None
        self._axes = SensorAxes.of(settings.imu_axes)
        self._newest: ImuSample | None = None
        self._gyro_step, self._accelerometer_step = GYRO_STEP, ACCELEROMETER_STEP
        if self.table is not None:
            gyro, accelerometer = self.table["gyro_x"].address, self.table["acc_x"].address
            longer = self.table["present_input_voltage"].address
        else:
            gyro, accelerometer = settings.gyro_address, settings.accelerometer_address
            self._gyro_step, self._accelerometer_step = (
                settings.gyro_scale,
                settings.accelerometer_scale,
            )
            longer = min(gyro, accelerometer)
        first, end = min(gyro, accelerometer), max(gyro, accelerometer) + AXES_BYTES
        self._size = end - first
        self._gyro_at, self._accelerometer_at = gyro - first, accelerometer - first
        self._spans = Span(first, self._size), Span(longer, end - longer)

    @property
    def name(self) -> str:
        """Return its name in messages."""
        model = f" '{self.settings.model}'" if self.settings.model else ""
        return f"board{model} (id {self.id})"

    def finding(self, text: str, remedy: str = REMEDY) -> Finding:
        """Build a finding about the board."""
        return Finding.error(self.name, text, remedy)

    def is_powering(self) -> bool:
        """Return whether the servos' power is on, as far as a known board switches it."""
        if self.table is None:
            return True
        return self.bus.read_item(self.id, self.table["dynamixel_power"]) == 1

    def span(self, cycle: int) -> Span:
        """Return the registers to read in a cycle; their length alternates against late replies.

        Those of a board without a table cannot: what is beside its IMU is unknown.
        """
        return self._spans[cycle % 2]

    def receive(self, data: bytes) -> None:
        """Take the registers of `span`, for the next `poll`."""
        self._newest = self.decode(data)

    def decode(self, data: bytes) -> ImuSample:
        """Convert the registers of `span` to SI, in the axes of the IMU site."""
        counts = data[-self._size :]
        gyro = np.frombuffer(counts, "<i2", 3, self._gyro_at)
        accelerometer = np.frombuffer(counts, "<i2", 3, self._accelerometer_at)
        return ImuSample(
            gyro=self._axes.to_site(gyro) * self._gyro_step,
            accelerometer=self._axes.to_site(accelerometer) * self._accelerometer_step,
            counts=counts,
        )

    # As a source of samples ---------------------------------------------------------------------

    def open(self) -> None:
        """Check that it replies, and configure it; its bus is open. Raises `ImuError`."""
        for problem in check_board(self):
            raise ImuError(problem.device, problem.text, problem.remedy)

    def close(self) -> None:
        """Forget what was received; the bus is closed by its owner."""
        self._newest = None

    def poll(self) -> ImuSample | None:
        """Return the sample of this cycle."""
        newest, self._newest = self._newest, None
        return newest

    def measure(self) -> ImuSample | None:
        """Read one sample; None if the board is silent."""
        status = self.bus.read(self.id, self._spans[0], TRIES)
        if status is None or len(status.data) < self._size:
            return None
        return self.decode(status.data)


def check_board(board: Board, *, set_delay: bool = True) -> list[Finding]:
    """Check that the board replies, set its return delay to 0, and switch the servos on."""
    status = board.bus.ping(board.id, TRIES)
    if status is None:
        rate = find_baud_rate(board.bus, [board.id])
        if rate is None:
            return [board.finding("silent")]
        text = f"uses {rate} bit/s, expected {board.bus.port.baud}"
        remedy = "set bus.baud in robot.toml, or the baud rates of board and servos"
        return [board.finding(text, remedy)]
    (number, _), table = read_identity(status), board.table
    if table is None:
        return []
    if number != table.number:
        return [board.finding(f"is of model {number}, expected {table.number}")]
    delay, bus = table["return_delay_time"], board.bus
    must_set = set_delay and bus.read_item(board.id, delay) != 0
    if must_set and not bus.write_item(board.id, delay, 0):
        return [board.finding("does not accept a return delay of 0")]
    if board.settings.powers_servos and not board.is_powering():
        bus.write_item(board.id, table["dynamixel_power"], 1)
        if not board.is_powering():
            return [board.finding("does not switch the servos' power on")]
    return []
