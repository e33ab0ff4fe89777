"""A virtual BNO055: its registers, on I2C and on a UART."""

from __future__ import annotations

from drivers.imu.bno055 import (
    ACC_DATA,
    ACCELEROMETER_STEP,
    ACCGYRO_MODE,
    CONFIG_MODE,
    GYR_DATA,
    GYRO_STEP,
    IDS,
    OPR_MODE,
    PAGE_ID,
)
from drivers.imu.register_link import DATA, DONE, READ, START, STATUS, WRITE
from drivers.virtual_bus.imu.i2c_chip import VirtualI2cChip
from drivers.virtual_bus.imu.reading import ImuReading, to_counts

PAGE_SIZE = 0x80
INVALID_ADDRESS, WRONG_START = 0x04, 0x06  # status bytes of a UART frame (data sheet, 4.7)


class VirtualBno055(VirtualI2cChip):
    """Two pages of registers; it measures in the mode that samples gyro and accelerometer.

    As on the chip, the registers of page 1 and the units may only be written in configuration
    mode, in which the data registers hold zeros.
    """

    def restart(self) -> None:
        """Lose power for a moment: all registers are as after power-up."""
        self.pages = [bytearray(PAGE_SIZE), bytearray(PAGE_SIZE)]
        self.pages[0][: len(IDS)] = IDS
        self._heard = b""

    @property
    def mode(self) -> int:
        """Return the operating mode."""
        return self.pages[0][OPR_MODE] & 0x0F

    def sense(self, reading: ImuReading) -> None:
        """Update the data registers."""
        if not self.frozen:
            self._reading = reading
            self._measure()

    def _measure(self) -> None:
        registers, reading = self.pages[0], self._reading
        gyro = accelerometer = bytes(6)
        if reading is not None and self.mode == ACCGYRO_MODE:
            gyro = to_counts(reading.gyro, GYRO_STEP)
            accelerometer = to_counts(reading.accelerometer, ACCELEROMETER_STEP)
        registers[GYR_DATA : GYR_DATA + 6] = gyro
        registers[ACC_DATA : ACC_DATA + 6] = accelerometer

    # Registers ------------------------------------------------------------------------------

    def read(self, register: int, count: int) -> bytes:
        """Return registers of the selected page; beyond its end there are zeros."""
        page = self.pages[self.pages[0][PAGE_ID] & 1]
        data = bytearray(page[register : register + count])
        return bytes(data.ljust(count, b"\0"))

    def write(self, register: int, value: int) -> None:
        """Set a register of the selected page, if it may be set in this mode."""
        selected = self.pages[0][PAGE_ID] & 1
        if register == PAGE_ID:
            self.pages[0][PAGE_ID] = self.pages[1][PAGE_ID] = value & 1
        elif selected == 0 and register == OPR_MODE:
            self.pages[0][OPR_MODE] = value
            self._measure()
        elif self.mode == CONFIG_MODE:
            self.pages[selected][register] = value

    # I2C ------------------------------------------------------------------------------------

    def exchange(self, data: bytes, count: int) -> bytes:
        """Write a register's address and values, then read on from there."""
        register, *values = data
        for place, value in enumerate(values):
            self.write(register + place, value)
        return self.read(register, count)

    # UART -----------------------------------------------------------------------------------

    def take(self) -> bytes:
        """Return nothing: it only replies."""
        return b""

    def repeat(self) -> bytes:
        """Return nothing: it only replies."""
        return b""

    def hear(self, data: bytes) -> bytes:
        """Execute all frames that have come whole; return the replies."""
        if not self.alive:
            return b""
        self._heard += data
        replies = b""
        while self._heard:
            if self._heard[0] != START:
                self._heard = b""
                return replies + bytes([STATUS, WRONG_START])
            if len(self._heard) < 4:
                return replies
            _, what, register, count = self._heard[:4]
            size = 4 + (count if what == WRITE else 0)
            if len(self._heard) < size:
                return replies
            values, self._heard = self._heard[4:size], self._heard[size:]
            replies += self._execute(what, register, count, values)
        return replies

    def _execute(self, what: int, register: int, count: int, values: bytes) -> bytes:
        if register + count > PAGE_SIZE or what not in (READ, WRITE):
            return bytes([STATUS, INVALID_ADDRESS])
        if what == READ:
            return bytes([DATA, count]) + self.read(register, count)
        for place, value in enumerate(values):
            self.write(register + place, value)
        return bytes([STATUS, DONE])
