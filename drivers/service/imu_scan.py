"""Finds IMU chips on the I2C buses of this computer, by their identification."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from drivers.imu.bno055 import CHIP_IDS, IDS
from drivers.imu.bno08x_i2c import CONTINUED, LONGEST_PACKET, PACKET
from drivers.imu.i2c import I2cChip, LinuxI2cChip

BNO055_ADDRESSES, BNO08X_ADDRESSES = (0x28, 0x29), (0x4A, 0x4B)  # by the address pin
CHANNELS = 6  # of a sensor hub


@dataclass(frozen=True, kw_only=True)
class FoundImu:
    """An IMU chip that replies."""

    path: str
    """Bus and address."""
    model: str


def list_i2c_buses() -> tuple[int, ...]:
    """List the I2C buses of this computer, N of each /dev/i2c-N."""
    numbers = (path.name.removeprefix("i2c-") for path in Path("/dev").glob("i2c-*"))
    return tuple(sorted(int(number) for number in numbers if number.isdecimal()))


def find_imus(
    buses: Sequence[int], make_chip: Callable[[int, int], I2cChip] = LinuxI2cChip
) -> list[FoundImu]:
    """Find the IMUs on some I2C buses; chips at other addresses are left alone."""
    found = []
    for bus in buses:
        for address in BNO055_ADDRESSES + BNO08X_ADDRESSES:
            is_bno055 = address in BNO055_ADDRESSES
            chip = make_chip(bus, address)
            if _replies(chip, _is_bno055 if is_bno055 else _is_bno08x):
                model = "BNO055" if is_bno055 else "BNO08x"
                found.append(FoundImu(path=chip.path, model=model))
    return found


def _replies(chip: I2cChip, is_expected: Callable[[I2cChip], bool]) -> bool:
    try:
        chip.open()
        return is_expected(chip)
    except OSError:  # no such bus, no permission, or no acknowledgement
        return False
    finally:
        chip.close()


def _is_bno055(chip: I2cChip) -> bool:
    return chip.transfer(bytes([CHIP_IDS]), len(IDS)) == IDS


def _is_bno08x(chip: I2cChip) -> bool:
    """Return whether a chip's reply begins with the header of a packet, or of none."""
    length, channel, _ = PACKET.unpack(chip.transfer(b"", PACKET.size))
    return (length & ~CONTINUED) <= LONGEST_PACKET and channel < CHANNELS
