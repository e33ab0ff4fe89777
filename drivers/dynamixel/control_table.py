"""Registers of Dynamixel devices: address, range and unit of every item."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from enum import IntEnum, IntFlag
from functools import cache, cached_property
from importlib.resources import files
from typing import Any

from drivers.dynamixel.protocol2 import Span
from drivers.errors import DriverError

SI_DIGITS = 9
"""Decimals of a value converted to SI: far below every unit of a register."""

FIRST_MAPPED = 64
"""Least register that an indirect address may name: the first of the RAM."""


class OperatingMode(IntEnum):
    """Quantity that a servo controls."""

    CURRENT = 0
    VELOCITY = 1
    POSITION = 3
    EXTENDED_POSITION = 4
    CURRENT_BASED_POSITION = 5
    PWM = 16


def name_mode(mode: int) -> str:
    """Return the name of an operating mode, or the number of an unknown one."""
    try:
        return OperatingMode(mode).name.lower().replace("_", " ")
    except ValueError:
        return str(mode)


class DriveMode(IntFlag):
    """Bits of the item ``drive_mode`` (e-manual)."""

    REVERSE = 1
    TIME_BASED = 4
    TORQUE_BY_GOAL = 8


class UnknownModelError(DriverError):
    """No control table is known for a model."""

    def __init__(self, model: str | int) -> None:
        known = ", ".join(f"{name} ({number})" for name, number in known_models().items())
        super().__init__(f"no control table of model {model}: known are {known}")
        self.model = model


@dataclass(frozen=True, kw_only=True)
class Item:
    """Entry of a control table."""

    name: str
    address: int
    size: int
    """[bytes]"""
    writable: bool
    eeprom: bool
    """Whether it keeps its value without power and is locked under torque."""
    default: int | None
    """Value after a factory reset or a power-up; None where it is measured."""
    lower: int | None
    """Smallest value that may be written; None for read-only items."""
    upper: int | None
    unit: str
    """SI unit, "share" of one, or "" for a plain count."""
    scale: float
    """Units per count."""
    signed: bool

    def to_si(self, count: int) -> float:
        """Convert a count to its SI unit.

        Rounded, so that 148 counts of 0.1 V compare equal to 14.8 V.
        """
        return round(count * self.scale, SI_DIGITS)

    @property
    def span(self) -> Span:
        """Return its registers."""
        return Span(self.address, self.size)

    @property
    def end(self) -> int:
        """Return the address one past it."""
        return self.address + self.size

    def encode(self, value: int) -> bytes:
        """Convert a value to register bytes.

        Raises:
            OverflowError: if the value does not fit into the item's bytes.
        """
        return value.to_bytes(self.size, "little", signed=self.signed)

    def decode(self, data: bytes) -> int:
        """Convert register bytes to a value.

        Raises:
            ValueError: if there are more or fewer bytes than the item has.
        """
        if len(data) != self.size:
            raise ValueError(f"{self.name} has {self.size} bytes, not {len(data)}")
        return int.from_bytes(data, "little", signed=self.signed)

    def accepts(self, value: int) -> bool:
        """Return whether a value may be written."""
        return (
            self.lower is not None and self.upper is not None and self.lower <= value <= self.upper
        )


@dataclass(frozen=True, kw_only=True)
class Indirect:
    """Block of indirect items: each data byte maps the register that its address names."""

    address: int
    """First address item, of two bytes each."""
    data: int
    """First data item, of one byte each."""
    count: int


@dataclass(frozen=True, kw_only=True)
class ControlTable:
    """All items of a device."""

    model: str
    number: int
    """Model number in the reply to a ping."""
    items: Mapping[str, Item]
    """By name, in order of address."""
    indirect: tuple[Indirect, ...]
    modes: tuple[int, ...]
    """Operating modes it has; empty if it is not a servo."""
    default_mode: int | None
    fast_read_firmware: int | None
    """First firmware with fast reads; None when none has them."""
    backup_firmware: int | None
    """First firmware with the backup instruction; None when none has it."""

    @cached_property
    def size(self) -> int:
        """Return the address one past the last register."""
        return max(item.end for item in self)

    @cached_property
    def _covering(self) -> tuple[Item | None, ...]:
        covering: list[Item | None] = [None] * self.size
        for item in self:
            covering[item.address : item.end] = [item] * item.size
        return tuple(covering)

    def __getitem__(self, name: str) -> Item:
        return self.items[name]

    def __contains__(self, name: object) -> bool:
        return name in self.items

    def __iter__(self) -> Iterator[Item]:
        return iter(self.items.values())

    def at(self, address: int) -> Item | None:
        """Return the item that covers an address, None in a gap or past the end."""
        return self._covering[address] if 0 <= address < self.size else None

    def span(self, first: str, last: str) -> Span:
        """Return the registers from one item to another, both included."""
        start = self[first].address
        return Span(start, self[last].end - start)

    def initial_bytes(self) -> bytearray:
        """Return the registers as they leave the factory; gaps and measured items are 0."""
        registers = bytearray(self.size)
        for item in self:
            if item.default is not None:
                registers[item.address : item.end] = item.encode(item.default)
        return registers

    def supports_fast_read(self, firmware: int) -> bool:
        """Return whether a firmware has fast reads."""
        return self.fast_read_firmware is not None and firmware >= self.fast_read_firmware

    def supports_backup(self, firmware: int) -> bool:
        """Return whether a firmware has the backup instruction."""
        return self.backup_firmware is not None and firmware >= self.backup_firmware


# Finding a table ----------------------------------------------------------------------------


def known_models() -> dict[str, int]:
    """Return the number of each model that has a table, by name."""
    return {name: model["number"] for name, model in _read_file()["models"].items()}


def table_for(number: int, firmware: int | None = None) -> ControlTable:
    """Find the table of a model number, as a device reports it in a ping; see `table_named`.

    Raises:
        UnknownModelError: if there is no such model.
    """
    for name, known in known_models().items():
        if known == number:
            return table_named(name, firmware)
    raise UnknownModelError(number)


@cache
def table_named(model: str, firmware: int | None = None) -> ControlTable:
    """Find the table of a model's name.

    Args:
        model: Name, such as "XM430-W350".
        firmware: Firmware version of the device; None for the newest known.

    Raises:
        UnknownModelError: if there is no such model.
    """
    if model not in known_models():
        raise UnknownModelError(model)
    source = _settings_of(model)
    indirect = _indirect_blocks(source, firmware)
    rows = [
        _build_item(name, row, source["units"], eeprom=memory == "eeprom")
        for memory in ("eeprom", "ram")
        for name, row in source[memory].items()
        if firmware is None or firmware >= row.get("since", 0)
    ]
    items = sorted([*rows, *_indirect_items(indirect)], key=lambda item: item.address)
    return ControlTable(
        model=model,
        number=source["number"],
        items={item.name: item for item in items},
        indirect=indirect,
        modes=tuple(source["modes"]),
        default_mode=source.get("default_mode"),
        fast_read_firmware=source.get("fast_read_firmware"),
        backup_firmware=source["ram"].get("backup_ready", {}).get("since"),
    )


# Reading the file ---------------------------------------------------------------------------


@cache
def _read_file() -> dict[str, Any]:
    file = files("drivers.dynamixel").joinpath("control_tables.toml")
    return tomllib.loads(file.read_text("utf-8"))


def _settings_of(model: str) -> dict[str, Any]:
    """Return all settings of a model, merged with those that it shares with others."""
    own, shared = _read_file()["models"][model], _read_file()["servo"]
    if not own.get("is_servo", True):
        shared = {"eeprom": {}, "ram": {}}
    without = own.get("without", [])
    memories = {
        memory: {
            name: shared[memory].get(name, {}) | own.get(memory, {}).get(name, {})
            for name in [*shared[memory], *own.get(memory, {})]
            if name not in without
        }
        for memory in ("eeprom", "ram")
    }
    memories["eeprom"]["model_number"]["default"] = own["number"]
    units = _read_file()["units"] | own.get("units", {})
    settings = shared | own | memories | {"units": units}
    return {key: value for key, value in settings.items() if key not in without}


def _build_item(name: str, row: dict[str, Any], units: dict[str, Any], *, eeprom: bool) -> Item:
    lower, upper = row.get("range", (None, None))
    unit = units[row.get("unit", "count")]
    return Item(
        name=name,
        address=row["at"],
        size=row.get("size", 1),
        writable=not row.get("read_only", False),
        eeprom=eeprom,
        default=row.get("default"),
        lower=lower,
        upper=upper,
        unit=unit["unit"],
        scale=unit["scale"],
        signed=row.get("signed", False),
    )


def _indirect_blocks(source: dict[str, Any], firmware: int | None) -> tuple[Indirect, ...]:
    blocks, old = source["indirect"], source.get("old_indirect")
    if old is not None and firmware is not None and firmware < old["before"]:
        blocks = old["blocks"]
    return tuple(Indirect(address=a, data=d, count=count) for a, d, count in blocks)


def _indirect_items(blocks: tuple[Indirect, ...]) -> Iterator[Item]:
    last = max((block.data + block.count - 1 for block in blocks), default=0)
    number = 0
    for block in blocks:
        for i in range(block.count):
            number += 1
            address, data = block.address + 2 * i, block.data + i
            where = {"at": address, "size": 2, "default": data, "range": (FIRST_MAPPED, last)}
            what = {"at": data, "default": 0, "range": (0, 255)}
            units = _read_file()["units"]
            yield _build_item(f"indirect_address_{number}", where, units, eeprom=False)
            yield _build_item(f"indirect_data_{number}", what, units, eeprom=False)
