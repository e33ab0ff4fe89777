"""Bosch BNO055: its gyro and accelerometer, without its own fusion."""

from __future__ import annotations

import math
import time
from collections import deque
from enum import Enum

import numpy as np

from drivers.imu.i2c import REMEDY, I2cChip
from drivers.imu.source import FIRST_SAMPLE, POLL_STEP, ImuError, ImuSample, ImuSource, SerialLink
from robots.imu import ImuSettings, SensorAxes

# Registers of page 0, and of page 1 (data sheet, 4.2).
CHIP_IDS, PAGE_ID, ACC_DATA, GYR_DATA, DATA_END = 0x00, 0x07, 0x08, 0x14, 0x1A
UNIT_SEL, OPR_MODE = 0x3B, 0x3D
ACC_CONFIG, GYR_CONFIG = 0x08, 0x0A
IDS = bytes([0xA0, 0xFB, 0x32, 0x0F])  # of the chip and its three sensors
CONFIG_MODE, ACCGYRO_MODE = 0, 5
SETUP = (
    (OPR_MODE, CONFIG_MODE, 0.019),  # s until the mode is reached (data sheet, 3.3)
    (PAGE_ID, 1, 0.0),
    (ACC_CONFIG, 0b000_100_10, 0.0),  # normal power, 125 Hz, 8 g
    (GYR_CONFIG, 0b010_000, 0.0),  # 116 Hz, 2000 deg/s
    (PAGE_ID, 0, 0.0),
    (UNIT_SEL, 0, 0.0),  # m/s², deg/s
    (OPR_MODE, ACCGYRO_MODE, 0.007),
)
"""Register, value, and the time to wait afterwards [s]."""
GYRO_STEP = math.radians(1.0 / 16.0)  # rad/s a count (data sheet, 3.6.4)
ACCELEROMETER_STEP = 0.01  # m/s² a count
BLANK = bytes(6)  # what the registers hold before the first measurement
# Frames of the BNO055 on a UART (data sheet, 4.7): AA, 01 to read or 00 to write, register,
# length, data. BB, length, data is the reply to a read; EE, status to a write or an error.
START, WRITE, READ = 0xAA, 0x00, 0x01
DATA, STATUS, DONE = 0xBB, 0xEE, 0x01
REPLY_TIME = 0.05  # s after which a reply is given up


class Purpose(Enum):
    """What the last request is for."""

    SETTING = "the next step of the setup"
    MODE = "the operating mode"
    DATA = "ids and data"


class Bno055(ImuSource):
    """A BNO055 of which one sample is requested in each cycle.

    Neither of its lines has a checksum. A reply counts only if it holds the ids of the chip and
    of its sensors at their places, which rejects cut and shifted replies, not a wrong bit in a
    value.
    """

    def __init__(
        self, settings: ImuSettings, line: I2cRegisters | UartRegisters, name: str
    ) -> None:
        self.name, self._line = name, line
        self._axes = SensorAxes.of(settings.axes)
        self._steps = deque(SETUP)  # that are still to come
        self._ready_at = self._now = self._requested_at = 0.0
        self._purpose = Purpose.DATA
        self._is_in_doubt = self._may_be_blank = False
        self._rejected = 0

    @property
    def damaged(self) -> int:
        """Return how many replies were dropped."""
        return self._line.damaged + self._rejected

    def open(self) -> None:
        """Open the line, and check the chip."""
        self._line.open()
        self._steps = deque(SETUP)
        found = self._read_ids()
        if found == IDS:
            return
        self._line.close()
        text = "silent" if found is None else f"has the chip ids {found.hex(' ')}"
        remedy = (
            f"expected a BNO055, {IDS.hex(' ')}: check its cable, its address and its mode pins"
        )
        raise ImuError(self.name, text, remedy)

    def close(self) -> None:
        """Close the line."""
        self._line.close()

    def request(self, now: float) -> None:
        """Request a sample, or continue to configure a chip that may have restarted."""
        self._now, line = now, self._line
        if line.is_busy or time.monotonic() < self._ready_at:
            return
        self._requested_at = now
        if self._steps:
            self._purpose = Purpose.SETTING
            register, value, _ = self._steps[0]
            line.write(register, value)
        elif self._is_in_doubt:
            self._purpose = Purpose.MODE
            line.read(OPR_MODE, 1)
        else:
            self._purpose = Purpose.DATA
            line.read(CHIP_IDS, DATA_END)

    def poll(self) -> ImuSample | None:
        """Return the sample of this cycle, or of the last if its reply took longer."""
        reply = self._line.take()
        if reply is None:
            return None
        if self._purpose is Purpose.SETTING:
            _, _, wait = self._steps.popleft()
            self._ready_at = time.monotonic() + wait
        elif self._purpose is Purpose.MODE:
            self._check_mode(reply[0])
        else:
            return self._decode(reply, self._now - self._requested_at)
        return None

    def _decode(self, data: bytes, age: float) -> ImuSample | None:
        gyro, accelerometer = data[GYR_DATA:DATA_END], data[ACC_DATA : ACC_DATA + 6]
        if len(data) != DATA_END or data[:4] != IDS or data[PAGE_ID] != 0:
            self._rejected += 1
            return None
        is_blank = gyro == BLANK and accelerometer == BLANK
        self._is_in_doubt = is_blank and not self._may_be_blank
        self._may_be_blank &= is_blank
        if self._is_in_doubt:
            return None
        return ImuSample(
            gyro=self._axes.to_site(np.frombuffer(gyro, "<i2")) * GYRO_STEP,
            accelerometer=self._axes.to_site(np.frombuffer(accelerometer, "<i2"))
            * ACCELEROMETER_STEP,
            counts=accelerometer + gyro,
            age=age,
        )

    def _check_mode(self, mode: int) -> None:
        """Find out whether zeros are a free fall, or those of a chip that has restarted."""
        self._is_in_doubt, self._may_be_blank = False, mode & 0x0F == ACCGYRO_MODE
        if not self._may_be_blank:
            self._steps = deque(SETUP)

    def _read_ids(self) -> bytes | None:
        """Read the chip's ids, waiting for a chip that boots; None if it is silent."""
        until = time.monotonic() + FIRST_SAMPLE
        found = None
        while found != IDS and time.monotonic() < until:
            if not self._line.is_busy:
                self._line.read(CHIP_IDS, len(IDS))
            found = self._line.take() or found
            if found != IDS:
                time.sleep(POLL_STEP)
        return found


# Its registers: nothing here waits, and only `open` raises ---------------------------------------


class I2cRegisters:
    """Registers over I2C: the reply is available at once."""

    is_busy = False
    """Whether a reply is still to come."""
    damaged = 0
    """How many replies were dropped because they were damaged."""

    def __init__(self, chip: I2cChip, name: str) -> None:
        self._chip, self._name = chip, name
        self._reply: bytes | None = None

    def open(self) -> None:
        """Open the bus."""
        try:
            self._chip.open()
        except OSError as error:
            raise ImuError(self._name, f"{error.strerror}", REMEDY) from error

    def close(self) -> None:
        """Close the bus."""
        self._chip.close()

    def read(self, register: int, count: int) -> None:
        """Read some registers."""
        self._transfer(bytes([register]), count)

    def write(self, register: int, value: int) -> None:
        """Set a register."""
        self._transfer(bytes([register, value]), 0)

    def take(self) -> bytes | None:
        """Return the reply to the last request."""
        reply, self._reply = self._reply, None
        return reply

    def _transfer(self, data: bytes, count: int) -> None:
        try:
            self._reply = self._chip.transfer(data, count)
        except OSError:  # the chip does not acknowledge
            self._reply = None


class UartRegisters:
    """Registers over a UART: the reply comes some cycles later, or never."""

    def __init__(self, link: SerialLink) -> None:
        self._link = link
        self.is_busy, self.damaged = False, 0
        self._buffer = b""
        self._count = 0  # bytes of the expected reply; 0 for a write
        self._give_up_at = 0.0

    def open(self) -> None:
        """Open the port."""
        self._link.open()
        self.is_busy = False

    def close(self) -> None:
        """Close the port."""
        self._link.close()

    def read(self, register: int, count: int) -> None:
        """Request some registers."""
        self._send(bytes([START, READ, register, count]), count)

    def write(self, register: int, value: int) -> None:
        """Request that a register is set."""
        self._send(bytes([START, WRITE, register, 1, value]), 0)

    def take(self) -> bytes | None:
        """Return the reply if it is complete and answers the last request."""
        self._buffer += self._link.receive()
        if not self.is_busy:
            self._buffer = b""
            return None
        size = 2 + self._count
        head = bytes([DATA, self._count]) if self._count else bytes([STATUS, DONE])
        if not head.startswith(self._buffer[:2]):
            return self._drop()
        if len(self._buffer) >= size:
            if len(self._buffer) > size:
                return self._drop()
            reply, self._buffer, self.is_busy = self._buffer[2:], b"", False
            return reply
        if time.monotonic() > self._give_up_at:
            self.is_busy = False
        return None

    def _drop(self) -> None:
        """Drop a reply that is damaged or an error; a new request may follow."""
        self._buffer, self.is_busy = b"", False
        self.damaged += 1

    def _send(self, frame: bytes, count: int) -> None:
        self._link.receive()  # a late reply to an older request
        self._buffer, self._count, self.is_busy = b"", count, True
        self._give_up_at = time.monotonic() + REPLY_TIME
        self._link.send(frame)
