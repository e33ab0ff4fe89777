"""Who answers on a serial port, at which speed, without knowing any robot."""

from __future__ import annotations

import re
from collections.abc import Container, Iterator, Sequence
from dataclasses import dataclass, replace

from serial.tools import list_ports

from drivers.dynamixel.bus import PING_DATA, BusStatistics, DynamixelBus
from drivers.dynamixel.control_table import BAUD_RATES, UnknownModelError, table_for
from drivers.dynamixel.diagnostics import read_items
from drivers.dynamixel.port import Port, PortError, PortLostError, read_latency_timer
from drivers.dynamixel.protocol2 import MAX_ID, OVERHEAD, Status
from drivers.errors import DriverError

COMMON_RATES = (57_600, 1_000_000, 2_000_000, 3_000_000, 4_000_000)
"""Speeds at which robots are usually run, and the one as shipped [bit/s]."""
SURE = 2  # garbled answers in a row that are no chance any more
PONG = OVERHEAD + 1 + PING_DATA  # bytes of an answer to a ping
BOARD_PORT = re.compile(r"/ttyS\d+$")  # soldered to the computer; no USB adapter

# What changes all the time or differs from servo to servo: two of one id that answer a ping
# with the same words garble each other here.
TELLTALES = (
    "realtime_tick",
    "present_position",
    "present_input_voltage",
    "present_temperature",
)


@dataclass(frozen=True, kw_only=True)
class PortFacts:
    """A serial port of this computer."""

    path: str
    description: str
    latency_timer: int | None
    """How long its adapter holds back a short answer [ms]; None when it has no say."""
    is_adapter: bool
    """False for a port of the computer's own board."""


@dataclass(frozen=True, kw_only=True)
class Answering:
    """A device that answers, or several of one id."""

    id: int
    baud: int
    """[bit/s]"""
    number: int | None = None
    """Model number as it tells it; None when its answers are garbled."""
    model: str | None = None
    """Name of the model; None when no table is known for it."""
    firmware: int | None = None
    voltage: float | None = None
    """Supply [V]; None where it does not tell it, as None is everywhere here."""
    temperature: float | None = None
    """[°C]"""
    is_board: bool = False
    """True when it is known to be no servo."""
    doubled: bool = False
    """True when its answers are garbled, as by two devices of one id."""


@dataclass(frozen=True, kw_only=True)
class PortScan:
    """What was found on one port."""

    path: str
    rates: tuple[int, ...] = ()
    """Speeds at which it was asked [bit/s]."""
    refused_rates: tuple[int, ...] = ()
    """Speeds that the adapter cannot do [bit/s]."""
    found: tuple[Answering, ...] = ()
    refusal: str | None = None
    """Why the port could not be asked; None when it was."""


def list_serial_ports() -> tuple[PortFacts, ...]:
    """List the serial ports of this computer, by name."""
    return tuple(
        PortFacts(
            path=port.device,
            description=port.description or "",
            latency_timer=read_latency_timer(port.device),
            is_adapter=port.vid is not None or not BOARD_PORT.search(port.device),
        )
        for port in sorted(list_ports.comports())
    )


def check_rate(baud: int) -> None:
    """Refuse a speed that no servo has.

    Raises:
        ValueError: telling which speeds there are.
    """
    if baud not in BAUD_RATES:
        allowed = ", ".join(map(str, BAUD_RATES))
        raise ValueError(f"baud is {baud} bit/s, allowed {allowed}")


def scan_port(port: Port, rates: Sequence[int]) -> PortScan:
    """Ask everybody on a port who he is, at some speeds; the port is closed afterwards.

    Only pings and reads are sent: nothing changes.

    Raises:
        PortError: when the port does not open at any of the speeds.
    """
    asked: list[int] = []
    refused: list[int] = []
    found: list[Answering] = []
    error: DriverError | None = None
    try:
        for rate in rates:
            try:
                port.set_baud(rate)
                port.open()
            except PortLostError:
                raise
            except PortError as refusal:
                refused.append(rate)
                error = error or refusal
                continue
            asked.append(rate)
            found += find_devices(DynamixelBus(port))
    finally:
        port.close()
    if not asked and error is not None:
        raise error
    return PortScan(
        path=port.path, rates=tuple(asked), refused_rates=tuple(refused), found=tuple(found)
    )


def find_devices(bus: DynamixelBus) -> list[Answering]:
    """List who answers on a bus at its present speed, in the order of the ids."""
    before = replace(bus.statistics)
    statuses = bus.find()
    is_garbled = _count_strange(bus, before) > len(statuses) * PONG
    found = [_examine(bus, status) for status in statuses.values()]
    if is_garbled:
        found += _ask_the_others(bus, statuses.keys())
    return sorted(found, key=lambda device: device.id)


def _ask_the_others(bus: DynamixelBus, known: Container[int]) -> Iterator[Answering]:
    """Ping each id alone of which no sound answer came to the ping of all."""
    for device in range(MAX_ID + 1):
        if device in known:
            continue
        for _ in range(SURE):
            before = replace(bus.statistics)
            status = bus.ping(device)
            if status is not None:
                yield _examine(bus, status)
                break
            if not _count_strange(bus, before):
                break
        else:
            yield Answering(id=device, baud=bus.port.baud, doubled=True)


def _count_strange(bus: DynamixelBus, before: BusStatistics) -> int:
    """Count the bytes that came since, unless an adapter only gave back what was sent."""
    passed = bus.statistics - before
    return 0 if passed.bytes_in == passed.bytes_out else passed.bytes_in


def _examine(bus: DynamixelBus, status: Status) -> Answering:
    number, firmware = int.from_bytes(status.data[:2], "little"), status.data[2]
    baud = bus.port.baud
    try:
        table = table_for(number, firmware)
    except UnknownModelError:
        return Answering(id=status.id, baud=baud, number=number, firmware=firmware)
    before = replace(bus.statistics)
    told = read_items(bus, status.id, table, TELLTALES)
    is_doubled = told is None and _count_strange(bus, before) > 0
    told = told or {}

    def scaled(name: str) -> float | None:
        return told[name] * table[name].scale if name in told else None

    return Answering(
        id=status.id,
        baud=baud,
        number=number,
        model=table.model,
        firmware=firmware,
        voltage=scaled("present_input_voltage"),
        temperature=scaled("present_temperature"),
        is_board=not table.modes,
        doubled=is_doubled,
    )
