"""What registers keep over a reboot, a factory reset, a backup."""

from __future__ import annotations

from collections.abc import Iterable

from drivers.control_table import Item
from drivers.protocol2 import Reset
from drivers.virtual.registers import Registers

GAINS = (
    "velocity_i_gain",
    "velocity_p_gain",
    "position_d_gain",
    "position_i_gain",
    "position_p_gain",
    "feedforward_2nd_gain",
    "feedforward_1st_gain",
)
PROFILE = ("profile_acceleration", "profile_velocity")
KEPT = {
    Reset.ALL: (),
    Reset.ALL_BUT_ID: ("id",),
    Reset.ALL_BUT_ID_AND_BAUD: ("id", "baud_rate"),
}


class Backup:
    """The stored copy of a servo's table: EEPROM, gains, profile, indirect addresses (e-manual)."""

    def __init__(self) -> None:
        self._values: dict[str, int] = {}

    @property
    def is_ready(self) -> bool:
        """Tell whether something is stored."""
        return bool(self._values)

    def store(self, registers: Registers) -> None:
        """Copy registers."""
        items = (item for item in registers.table if _is_backed_up(item))
        self._values = {item.name: registers[item.name] for item in items}

    def restore_eeprom(self, registers: Registers) -> None:
        """Bring the stored EEPROM back."""
        self._restore(registers, eeprom=True)

    def restore_ram(self, registers: Registers) -> None:
        """Bring the stored gains, profile and indirect addresses back."""
        self._restore(registers, eeprom=False)

    def _restore(self, registers: Registers, *, eeprom: bool) -> None:
        for name, value in self._values.items():
            if registers.table[name].eeprom == eeprom:
                registers[name] = value


def reset_eeprom(registers: Registers, kept: Reset) -> None:
    """Bring EEPROM back to what the factory wrote, but for what is kept."""
    items = (item for item in registers.table if item.eeprom and item.writable)
    reset(registers, (item for item in items if item.name not in KEPT[kept]))


def reset_ram(registers: Registers) -> None:
    """Bring RAM back to its values at power-up; measured items stay."""
    reset(registers, (item for item in registers.table if not item.eeprom))


def reset(registers: Registers, items: Iterable[Item]) -> None:
    """Bring items back to their defaults."""
    for item in items:
        if item.default is not None:
            registers[item.name] = item.default


def _is_backed_up(item: Item) -> bool:
    if item.eeprom:
        return item.writable
    return item.name in GAINS + PROFILE or item.name.startswith("indirect_address_")
