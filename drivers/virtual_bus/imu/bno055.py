"""A virtual BNO055: its registers, on I2C and on a UART."""

from __future__ import annotations

import numpy as np

from drivers.imu.fusion import GRAVITY
from drivers.virtual_bus.imu.virtual_imu import (
    ImuReading,
    VirtualI2cChip,
    VirtualUartImu,
    to_counts,
)

# All numbers here are the data sheet's own (BST-BNO055-DS000), none is the driver's: what one side
# gets wrong, the other does not follow.
PAGE_SIZE = 0x80
IDS = bytes([0xA0, 0xFB, 0x32, 0x0F])  # of the chip, its accelerometer, magnetometer and gyro
PAGE_ID, ACC_DATA, GYR_DATA = 0x07, 0x08, 0x14  # of page 0, as the next two
UNIT_SEL, OPR_MODE = 0x3B, 0x3D
ACC_CONFIG, GYR_CONFIG = 0x08, 0x0A  # of page 1
POWER_UP = ({UNIT_SEL: 0x80}, {ACC_CONFIG: 0x0D, GYR_CONFIG: 0x38})
"""Registers of each page that are not 0 after power-up (4.2)."""
CONFIG_MODE = 0
ACC_MODES = (1, 4, 5, 7, 8, 9, 10, 11, 12)  # in which it measures (table 3-3)
GYR_MODES = (3, 5, 6, 7, 8, 11, 12)
ACC_RANGES = {0: 2.0, 1: 4.0, 2: 8.0, 3: 16.0}  # g, by bits 0 and 1 of ACC_CONFIG
GYR_RANGES = {0: 2000.0, 1: 1000.0, 2: 500.0, 3: 250.0, 4: 125.0}  # deg/s, by bits 0 to 2
ACC_STEPS = (0.01, 1e-3 * GRAVITY)  # m/s² a count, by bit 0 of UNIT_SEL: m/s² or mg (3.6.4)
GYR_STEPS = (np.radians(1.0 / 16.0), 1.0 / 900.0)  # rad/s a count, by bit 1: deg/s or rad/s
# Bytes of a frame on a UART (4.7).
START, WRITE, READ, DATA, STATUS, DONE = 0xAA, 0x00, 0x01, 0xBB, 0xEE, 0x01
INVALID_ADDRESS, WRONG_START = 0x04, 0x06


class VirtualBno055(VirtualI2cChip, VirtualUartImu):
    """Two pages of registers, which also select what it measures and in what units.

    As on the chip, the registers of page 1 and the units may only be written in configuration
    mode, in which the data registers hold zeros.
    """

    def restart(self) -> None:
        """Lose power for a moment: all registers are as after power-up."""
        self.pages = [bytearray(PAGE_SIZE), bytearray(PAGE_SIZE)]
        for page, values in zip(self.pages, POWER_UP, strict=True):
            for register, value in values.items():
                page[register] = value
        self.pages[0][: len(IDS)] = IDS
        self._received = b""

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
        registers, configuration = self.pages
        gyro = accelerometer = bytes(6)
        if self._reading is not None and self.mode in ACC_MODES:
            reach = GRAVITY * ACC_RANGES[configuration[ACC_CONFIG] & 0b11]
            force = np.clip(self._reading.accelerometer, -reach, reach)
            accelerometer = to_counts(force, ACC_STEPS[registers[UNIT_SEL] & 1])
        if self._reading is not None and self.mode in GYR_MODES:
            reach = np.radians(GYR_RANGES.get(configuration[GYR_CONFIG] & 0b111, 0.0))
            rate = np.clip(self._reading.gyro, -reach, reach)
            gyro = to_counts(rate, GYR_STEPS[registers[UNIT_SEL] >> 1 & 1])
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
        elif self.mode == CONFIG_MODE and register < PAGE_SIZE:
            self.pages[selected][register] = value

    # I2C ------------------------------------------------------------------------------------

    def exchange(self, data: bytes, count: int) -> bytes:
        """Write a register's address and values, then read on from there; without one, from 0."""
        register, *values = data or b"\0"
        for place, value in enumerate(values):
            self.write(register + place, value)
        return self.read(register, count)

    # UART -----------------------------------------------------------------------------------

    def receive(self, data: bytes) -> bytes:
        """Execute all frames that have come whole; return the replies."""
        if not self.alive:
            return b""
        self._received += data
        replies = b""
        while self._received:
            if self._received[0] != START:
                self._received = b""
                return replies + bytes([STATUS, WRONG_START])
            if len(self._received) < 4:
                return replies
            _, what, register, count = self._received[:4]
            size = 4 + (count if what == WRITE else 0)
            if len(self._received) < size:
                return replies
            values, self._received = self._received[4:size], self._received[size:]
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
