"""A control table in memory: reads and writes of address ranges."""

from __future__ import annotations

import struct
from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache

from drivers.dynamixel.control_table import ControlTable, Item
from drivers.dynamixel.protocol2 import ErrorNumber

MAX_PLANS = 256  # cached; clients use a handful, a fuzzer many
_POINTER, _TARGET = "indirect_address_", "indirect_data_"
MAX_COUNTS = 0x7FFFFFFF  # of a signed four-byte register


@dataclass(frozen=True, slots=True)
class Field:
    """One item of a write."""

    name: str
    offset: int
    """Position of its first byte in the data."""
    address: int
    codec: Codec
    lower: int
    upper: int


@dataclass(frozen=True, slots=True)
class WritePlan:
    """The items that a write to an address range sets, whatever its data."""

    error: int = 0
    """`ErrorNumber` if the range cannot be written at all."""
    fields: tuple[Field, ...] = ()
    eeprom: bool = False
    """True when it touches EEPROM."""
    remaps: bool = False
    """True when it changes indirect addresses."""


class Registers:
    """The memory of a control table.

    Inside a longer read, addresses without an item are zeros; writing them does nothing. The
    manual gives error 7 for them, yet its own clients read across gaps.
    """

    def __init__(self, table: ControlTable) -> None:
        self.table = table
        self.memory = table.initial_bytes()
        self._codecs = {item.name: codec_of(item) for item in table.items.values()}
        self._addresses = {item.name: item.address for item in table.items.values()}
        self._defined = bytearray(table.size)
        self._redirected = bytearray(table.size)
        self._pointers: dict[int, int] = {}  # address of indirect data -> address of its pointer
        for item in table.items.values():
            self._defined[item.address : item.address + item.size] = b"\x01" * item.size
            if item.name.startswith(_TARGET):
                number = item.name.removeprefix(_TARGET)
                self._pointers[item.address] = table[_POINTER + number].address
                self._redirected[item.address] = 1
        self._resolve = lru_cache(MAX_PLANS)(self._resolve_indirect)
        self.plan_write = lru_cache(MAX_PLANS)(self._plan_write)
        """Returns what a write to an address range (address, length) sets."""

    def __getitem__(self, name: str) -> int:
        return self._codecs[name].unpack_from(self.memory, self._addresses[name])[0]

    def __setitem__(self, name: str, value: int) -> None:
        """Set an item's value, regardless of access rights and range."""
        self._codecs[name].pack_into(self.memory, self._addresses[name], value)
        if name.startswith(_POINTER):
            self.clear_plans()

    def __contains__(self, name: str) -> bool:
        return name in self._addresses

    def reset(self, items: Iterable[Item]) -> None:
        """Reset items to their defaults; measured ones stay."""
        for item in items:
            if item.default is not None:
                self[item.name] = item.default

    def reset_ram(self) -> None:
        """Reset RAM to its power-up values."""
        self.reset(item for item in self.table if not item.eeprom)

    def get(self, name: str, default: int = 0) -> int:
        """Return an item's value, or another one if the table lacks it."""
        return self[name] if name in self._addresses else default

    def read(self, address: int, length: int) -> tuple[int, bytes]:
        """Return an `ErrorNumber` and the bytes of an address range."""
        end = address + length
        if not length:
            return ErrorNumber.DATA_LENGTH, b""
        if end > len(self.memory) or not self._defined[address]:
            return ErrorNumber.ACCESS, b""
        if self._redirected.find(1, address, end) < 0:
            return 0, bytes(self.memory[address:end])
        memory = self.memory
        return 0, bytes([memory[a] for a in self._resolve(address, length)])

    def clear_plans(self) -> None:
        """Clear the cache after a change of indirect addresses."""
        self._resolve.cache_clear()
        self.plan_write.cache_clear()

    def _resolve_indirect(self, address: int, length: int) -> list[int]:
        # Indirect data that points to indirect data reads plain memory there.
        pointers, memory = self._pointers, self.memory
        return [
            memory[pointers[a]] | memory[pointers[a] + 1] << 8 if a in pointers else a
            for a in range(address, address + length)
        ]

    def _plan_write(self, address: int, length: int) -> WritePlan:
        if not length:
            return WritePlan(ErrorNumber.DATA_LENGTH)
        if address + length > len(self.memory) or not self._defined[address]:
            return WritePlan(ErrorNumber.ACCESS)
        addresses = self._resolve(address, length)
        fields: list[Field] = []
        eeprom = remaps = False
        offset = 0
        while offset < length:
            item = self.table.at(addresses[offset])
            if item is None:
                if offset == 0:
                    return WritePlan(ErrorNumber.ACCESS)
                offset += 1
                continue
            if not item.writable:
                return WritePlan(ErrorNumber.ACCESS)
            if addresses[offset : offset + item.size] != list(range(item.address, item.end)):
                return WritePlan(ErrorNumber.DATA_LENGTH)
            fields.append(_field_of(item, offset, self._codecs[item.name]))
            eeprom |= item.eeprom
            remaps |= item.name.startswith(_POINTER)
            offset += item.size
        return WritePlan(0, tuple(fields), eeprom, remaps)


def clamp(value: int, limit: int) -> int:
    """Clamp a value to a symmetric limit."""
    return max(-limit, min(limit, value))


class SignCodec:
    """Codec of an item whose sign is a bit of its own."""

    def __init__(self, item: Item) -> None:
        self._item = item

    def pack_into(self, memory: bytearray, address: int, value: int) -> None:
        """Store a value."""
        memory[address : address + self._item.size] = self._item.encode(value)

    def unpack_from(self, memory: bytes | bytearray, address: int) -> tuple[int]:
        """Load a value."""
        return (self._item.decode(bytes(memory[address : address + self._item.size])),)


Codec = struct.Struct | SignCodec


def codec_of(item: Item) -> Codec:
    """Return the codec of an item."""
    if item.sign_bit is not None:
        return SignCodec(item)
    letter = {1: "b", 2: "h", 4: "i"}[item.size]
    return struct.Struct("<" + (letter if item.signed else letter.upper()))


def _field_of(item: Item, offset: int, codec: Codec) -> Field:
    bits = 8 * item.size
    least, most = (-(1 << bits - 1), (1 << bits - 1) - 1) if item.signed else (0, (1 << bits) - 1)
    lower = least if item.lower is None else item.lower
    upper = most if item.upper is None else item.upper
    return Field(item.name, offset, item.address, codec, lower, upper)
