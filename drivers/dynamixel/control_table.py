"""Registers of Dynamixel devices: address, range and unit of every item."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from enum import IntEnum, IntFlag
from functools import cache, cached_property
from importlib.resources import files
from typing import Any

from drivers.dynamixel.protocol2 import Instruction, Span
from drivers.dynamixel.wire import WIRES, Wire
from drivers.errors import DriverError, SetupError
from robots.bus_settings import BAUD_RATES

FILES = ("control_tables.toml", "protocol1_tables.toml", "feetech_tables.toml")
SI_DIGITS = 9
"""Decimals of a value converted to SI: far below every unit of a register."""

POSITIONS = (
    "goal_position",
    "present_position",
    "min_position_limit",
    "max_position_limit",
    "position_trajectory",
)
"""Items that are positions of the horn: 0 rad is the middle of the turn."""

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

    def describe(self) -> str:
        """Return its name in words."""
        return self.name.lower().replace("_", " ")


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
    sign_bit: int | None = None
    """Bit that says that a number is negative, above those of its amount; None for two's
    complement."""

    @property
    def kind(self) -> str:
        """Return its numpy type, such as "<i4"; a number with a sign bit is unsigned there."""
        letter = "i" if self.signed and self.sign_bit is None else "u"
        return f"<{letter}{self.size}"

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
        """Convert a value to register bytes; raises `OverflowError` if it does not fit."""
        if self.sign_bit is not None:
            if abs(value) >> self.sign_bit:
                raise OverflowError(f"{self.name} is {value}: too large for its bits")
            value = abs(value) | (value < 0) << self.sign_bit
        signed = self.signed and self.sign_bit is None
        return value.to_bytes(self.size, "little", signed=signed)

    def decode(self, data: bytes) -> int:
        """Convert register bytes to a value; raises `ValueError` for another number of bytes."""
        if len(data) != self.size:
            raise ValueError(f"{self.name} has {self.size} bytes, not {len(data)}")
        if self.sign_bit is None:
            return int.from_bytes(data, "little", signed=self.signed)
        number = int.from_bytes(data, "little")
        amount = number & ((1 << self.sign_bit) - 1)  # bits above the sign's are ignored
        return -amount if number >> self.sign_bit & 1 else amount

    def accepts(self, value: int) -> bool:
        """Return whether a value may be written."""
        return (
            self.lower is not None and self.upper is not None and self.lower <= value <= self.upper
        )


@dataclass(frozen=True, kw_only=True)
class ControlTable:
    """All items of a device."""

    model: str
    number: int
    """Model number in the reply to a ping."""
    items: Mapping[str, Item]
    """By name, in order of address."""
    modes: tuple[int, ...]
    """Operating modes it has; empty if there is no register for them."""
    default_mode: int | None
    fast_read_firmware: int | None
    """First firmware with fast reads; None when none has them."""
    is_servo: bool = True
    wire: Wire = WIRES["2.0"]
    """Protocol that it speaks."""
    extra_instructions: frozenset[int] = frozenset()
    """Instructions that it knows beside those of all devices of its protocol."""
    mode_names: Mapping[int, str] = field(default_factory=dict)
    """Names of its operating modes; empty for those of `OperatingMode`."""
    bauds: Mapping[int, int] = field(default_factory=lambda: dict(enumerate(BAUD_RATES)))
    """Baud rate [bit/s] of each value of the item ``baud_rate``."""
    error_bits: tuple[int, ...] = ()
    """Bit of `HardwareError` that each bit of its errors means; empty if they are the same."""
    prepared: Mapping[str, int] = field(default_factory=dict)
    """Values that the driver gives items before torque comes on, beside those it computes."""
    keeps_by_lock: str | None = None
    """Item that is 0 while writes to the EEPROM are kept without power; None without a lock."""

    @cached_property
    def size(self) -> int:
        """Return the address one past the last register."""
        return max(item.end for item in self)

    @property
    def instructions(self) -> frozenset[int]:
        """Return all instructions that it knows."""
        return self.wire.instructions | self.extra_instructions

    @property
    def has_watchdog(self) -> bool:
        """Return whether it stops by itself when its program falls silent."""
        return "bus_watchdog" in self.items

    @property
    def counts_turns(self) -> bool:
        """Return whether it counts on beyond one turn, in the modes in which it is driven."""
        return OperatingMode.EXTENDED_POSITION in self.modes and not self.mode_names

    @property
    def all_answered(self) -> int:
        """Return the status return level at which every instruction is confirmed."""
        return self["status_return_level"].upper or 0

    def to_si(self, name: str, count: int) -> float:
        """Convert an item's count to its unit; a position to the angle from the middle [rad]."""
        if name in POSITIONS:
            count -= ((self["max_position_limit"].upper or 0) + 1) // 2
        return self[name].to_si(count)

    def baud_code(self, baud: int) -> int:
        """Return the value of ``baud_rate`` for a rate [bit/s]; raises `SetupError` without it."""
        for code, rate in self.bauds.items():
            if rate == baud:
                return code
        listed = ", ".join(map(str, sorted(self.bauds.values())))
        raise SetupError(f"{self.model}: baud rate is {baud} bit/s, expected {listed}")

    def name_mode(self, mode: int) -> str:
        """Return the name of an operating mode, or the number of an unknown one."""
        if self.mode_names:
            return self.mode_names.get(mode, str(mode))
        try:
            return OperatingMode(mode).describe()
        except ValueError:
            return str(mode)

    def name_errors(self, bits: int) -> int:
        """Convert its error bits, as it shows them, to those of `HardwareError`."""
        if not self.error_bits:
            return bits
        return sum({known for i, known in enumerate(self.error_bits) if bits >> i & 1})

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


# Finding a table ----------------------------------------------------------------------------


def known_models() -> dict[str, int]:
    """Return the number of each model that has a table, by name."""
    return {name: model["number"] for name, model in _read_file()["models"].items()}


@cache
def table_names() -> Mapping[str, str]:
    """Return the model whose table each type of servo has, by the type's name."""
    models = _read_file()["models"]
    return {t: name for name, model in models.items() for t in (name, *model.get("types", ()))}


def types_of(table: ControlTable) -> list[str]:
    """Return the types of servo that have a table, and that its registers cannot tell apart."""
    return [name for name, model in table_names().items() if model == table.model]


def table_for(number: int, firmware: int | None = None, wire: Wire = WIRES["2.0"]) -> ControlTable:
    """Find the table of a model number, as a device of a protocol reports it; see `table_named`."""
    for name, known in known_models().items():
        if known == number and _wire_of(name) is wire:
            return table_named(name, firmware)
    raise UnknownModelError(number)


@cache
def table_named(model: str, firmware: int | None = None) -> ControlTable:
    """Find the table of a model's name.

    Args:
        model: Name of a model, such as "XM430-W350", or of a type of servo that has its table.
        firmware: Firmware version of the device; None for the newest known.
    """
    if model not in table_names():
        raise UnknownModelError(model)
    if table_names()[model] != model:
        return table_named(table_names()[model], firmware)
    source = _settings_of(model)
    rows = [
        _build_item(name, row, source, eeprom=memory == "eeprom")
        for memory in ("eeprom", "ram")
        for name, row in source[memory].items()
        if firmware is None or firmware >= row.get("since", 0)
    ]
    items = sorted([*rows, *_indirect_items(source, firmware)], key=lambda item: item.address)
    return ControlTable(
        model=model,
        number=source["number"],
        items={item.name: item for item in items},
        modes=tuple(source.get("modes", ())),
        default_mode=source.get("default_mode"),
        fast_read_firmware=source.get("fast_read_firmware"),
        is_servo=source.get("is_servo", True),
        wire=_wire_of(model),
        extra_instructions=frozenset(Instruction[name] for name in source.get("knows", [])),
        mode_names={int(mode): name for mode, name in source.get("mode_names", {}).items()},
        error_bits=tuple(source.get("error_bits", ())),
        prepared=source.get("prepared", {}),
        keeps_by_lock=source.get("keeps_by_lock"),
        **({"bauds": dict(source["bauds"])} if "bauds" in source else {}),
    )


# Reading the file ---------------------------------------------------------------------------


@cache
def _read_file() -> dict[str, Any]:
    """Read the files of all protocols: units, series and models, by name."""
    merged: dict[str, Any] = {"units": {}, "series": {}, "models": {}}
    for name in FILES:
        text = files("drivers.dynamixel").joinpath(name).read_text("utf-8")
        for part, rows in tomllib.loads(text).items():
            merged[part] |= rows
    return merged


def _series_of(model: str) -> dict[str, Any]:
    """Return what a model has in common with others; the X series if it does not say."""
    own = _read_file()["models"][model]
    return _read_file()["series"][own.get("series", "X")]


@cache
def _wire_of(model: str) -> Wire:
    return WIRES[_series_of(model).get("protocol", "2.0")]


def _settings_of(model: str) -> dict[str, Any]:
    """Return all settings of a model, merged with those that it shares with others."""
    own, shared = _read_file()["models"][model], _series_of(model)
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
    units = _read_file()["units"] | shared.get("units", {}) | own.get("units", {})
    settings = shared | own | memories | {"units": units}
    return {key: value for key, value in settings.items() if key not in without}


def _build_item(name: str, row: dict[str, Any], source: dict[str, Any], *, eeprom: bool) -> Item:
    lower, upper = row.get("range", (None, None))
    unit = source["units"][row.get("unit", "count")]
    sign_bit = row.get("sign_bit")
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
        signed=row.get("signed", sign_bit is not None),
        sign_bit=sign_bit,
    )


def _indirect_items(source: dict[str, Any], firmware: int | None) -> Iterator[Item]:
    """Yield the indirect items: each data byte maps the register that its address names."""
    blocks, old = source.get("indirect", []), source.get("old_indirect")
    if old is not None and firmware is not None and firmware < old["before"]:
        blocks = old["blocks"]
    last = max((data + count - 1 for _, data, count in blocks), default=0)
    pairs = [(at + 2 * i, data + i) for at, data, count in blocks for i in range(count)]
    for number, (address, data) in enumerate(pairs, start=1):
        where = {"at": address, "size": 2, "default": data, "range": (FIRST_MAPPED, last)}
        what = {"at": data, "default": 0, "range": (0, 255)}
        units = {"units": _read_file()["units"]}
        yield _build_item(f"indirect_address_{number}", where, units, eeprom=False)
        yield _build_item(f"indirect_data_{number}", what, units, eeprom=False)
