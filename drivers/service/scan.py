"""Finds devices, independent of the robot: on serial ports at all baud rates, IMUs on I2C."""

from __future__ import annotations

import re
from collections.abc import Callable, Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from serial.tools import list_ports

from drivers.dynamixel.bus import PING_DATA, TRIES, BusStatistics, DynamixelBus
from drivers.dynamixel.control_table import ControlTable, UnknownModelError, table_for
from drivers.dynamixel.diagnostics import read_items
from drivers.dynamixel.protocol2 import MAX_ID, OVERHEAD, Status, read_identity
from drivers.dynamixel.requests import Request
from drivers.dynamixel.robot_ports import using_margin
from drivers.dynamixel.wire import PROTOCOL_2, WIRES, Wire
from drivers.errors import DriverError
from drivers.imu.bno055 import CHIP_IDS, IDS
from drivers.imu.bno08x import CONTINUED, LONGEST_PACKET, PACKET
from drivers.imu.i2c import I2cChip, LinuxI2cChip
from drivers.serial_port import PortRefusedError, SerialPort, read_latency_timer
from drivers.service.sweep import ALIKE, list_speakers
from robots.bus_settings import BAUD_RATES

COMMON_RATES = (57_600, 1_000_000, 2_000_000, 3_000_000, 4_000_000)
"""Baud rates of most robots, and the one as shipped [bit/s]."""
GARBLED_REPLIES = 3  # garbled replies in a row, on a silent line, that are not a coincidence
CONFIRM_MARGIN = 0.05  # s; longer than an adapter or a busy computer holds back a reply
PONG = OVERHEAD + 1 + PING_DATA  # bytes of a reply to a ping
EITHER = " or ".join(alike.name for alike in ALIKE)  # of which it is not known what it speaks
ONBOARD_PORT = re.compile(r"/ttyS\d+$")  # on the mainboard, not a USB adapter
BNO055_ADDRESSES, BNO08X_ADDRESSES = (0x28, 0x29), (0x4A, 0x4B)  # by the address pin
CHANNELS = 6  # of a sensor hub

# Values that change all the time or differ between servos: two of one id that reply equally
# to a ping garble each other here.
TELLTALES = ("realtime_tick", "present_position", "present_input_voltage", "present_temperature")
MEASURED = (
    "operating_mode",
    "torque_enable",
    "hardware_error_status",
    "present_current",
    "present_load",
    "present_velocity",
    "present_position",
    "present_input_voltage",
    "present_temperature",
)
"""What is read of each device, where it has it."""


@dataclass(frozen=True, kw_only=True)
class PortFacts:
    """A serial port of this computer."""

    path: str
    description: str
    latency_timer: int | None
    """How long its adapter holds back a short reply [ms]; None if it has no timer."""
    is_adapter: bool
    """False for a port on the mainboard."""


@dataclass(frozen=True, kw_only=True)
class FoundDevice:
    """A device that replies, or several of one id."""

    id: int
    baud: int
    """[bit/s]"""
    number: int | None = None
    """Model number; None if its replies are garbled, or what it speaks is unclear."""
    table: ControlTable | None = None
    """None for a model without a control table here, or an unknown one."""
    firmware: int | None = None
    values: Mapping[str, int] = field(default_factory=dict)
    """What it measures, by register [counts]; empty if it could not be read."""
    protocol: str = PROTOCOL_2.name
    """What it speaks; both names if it may be either."""
    doubled: bool = False
    """Whether its replies are garbled again and again, as by two devices of one id."""
    only_pings: bool = False
    """Whether it replies to pings alone."""

    @property
    def model(self) -> str | None:
        """Return the name of its model, if it has a control table."""
        return self.table and self.table.model

    @property
    def is_board(self) -> bool:
        """Return whether it is known not to be a servo."""
        return self.table is not None and not self.table.is_servo


@dataclass(frozen=True, kw_only=True)
class PortScan:
    """Devices found on one port."""

    path: str
    rates: tuple[int, ...] = ()
    """Baud rates that were tried [bit/s]."""
    refused_rates: tuple[int, ...] = ()
    """Baud rates that the adapter does not support [bit/s]."""
    found: tuple[FoundDevice, ...] = ()
    refusal: str | None = None
    """Why the port could not be scanned; None if it was."""


def list_serial_ports() -> tuple[PortFacts, ...]:
    """List the serial ports of this computer, by name."""
    return tuple(
        PortFacts(
            path=port.device,
            description=port.description or "",
            latency_timer=read_latency_timer(port.device),
            is_adapter=port.vid is not None or not ONBOARD_PORT.search(port.device),
        )
        for port in sorted(list_ports.comports())
    )


def check_rate(baud: int) -> None:
    """Refuse a baud rate that no servo has."""
    if baud not in BAUD_RATES:
        raise ValueError(f"baud is {baud} bit/s, expected {', '.join(map(str, BAUD_RATES))}")


def scan_port(
    port: SerialPort, rates: Sequence[int], wires: Sequence[Wire] = tuple(WIRES.values())
) -> PortScan:
    """Find the devices of some protocols on a port at some baud rates; it is closed afterwards.

    Only pings and reads are sent: nothing changes.
    """
    tried: list[int] = []
    refused: list[int] = []
    found: list[FoundDevice] = []
    error: DriverError | None = None
    bus = DynamixelBus(port)
    try:
        for rate in rates:
            try:
                port.set_baud(rate)
                port.open()
            except PortRefusedError as refusal:
                refused.append(rate)
                error = error or refusal
                continue
            tried.append(rate)
            if PROTOCOL_2 in wires:
                found += _find_broadcast(bus)
        if not found:  # each silent id costs a wait: only where nothing speaks Protocol 2.0
            for rate in tried:
                port.set_baud(rate)
                found += _find_swept(bus, wires)
    finally:
        port.close()
    if not tried and error is not None:
        raise error
    return PortScan(
        path=port.path, rates=tuple(tried), refused_rates=tuple(refused), found=tuple(found)
    )


def _find_broadcast(bus: DynamixelBus) -> list[FoundDevice]:
    """List what replies to a ping of all ids in Protocol 2.0."""
    before = replace(bus.statistics)
    bus.wire = PROTOCOL_2
    statuses = bus.ping_all()
    is_garbled = _count_garbled_bytes(bus, before) > len(statuses) * PONG
    repeated = set(bus.repeated)
    found = [_examine(bus, s, is_suspect=s.id in repeated) for s in statuses.values()]
    if is_garbled:
        found += _ping_others(bus, statuses.keys())
    return sorted(found, key=lambda device: device.id)


def _find_swept(bus: DynamixelBus, wires: Sequence[Wire]) -> list[FoundDevice]:
    """List what replies in another protocol, one id after the other."""
    damaged = bus.statistics.damaged
    speakers = list_speakers(bus, wires)
    is_garbled = bus.statistics.damaged > damaged
    found = [_examine_at(bus, *speaker) for speaker in speakers.items()]
    if is_garbled:
        bus.wire = ALIKE[0]
        found += _ping_others(bus, speakers.keys())
    return sorted(found, key=lambda device: device.id)


def _examine_at(bus: DynamixelBus, device: int, wire: Wire | None) -> FoundDevice:
    if wire is None:
        return FoundDevice(id=device, baud=bus.port.baud, protocol=EITHER)
    bus.wire = wire
    with using_margin((bus,), CONFIRM_MARGIN):
        status = bus.ping(device, TRIES)
    if status is not None:
        return _examine(bus, status)
    doubled = _is_doubled(bus, [bus.ask_identity(device)])
    return FoundDevice(
        id=device,
        baud=bus.port.baud,
        protocol=wire.name,
        doubled=doubled,
        only_pings=not doubled and bus.hears(device),
    )


def _ping_others(bus: DynamixelBus, known: Container[int]) -> Iterator[FoundDevice]:
    """Ping each id alone that gave no intact reply before."""
    for device in range(MAX_ID + 1):
        if device in known:
            continue
        before = replace(bus.statistics)
        status = bus.ping(device)
        if status is None and _count_garbled_bytes(bus, before):
            if _is_doubled(bus, [bus.ask_identity(device)]):
                protocol = bus.wire.name if bus.wire is PROTOCOL_2 else EITHER
                yield FoundDevice(id=device, baud=bus.port.baud, protocol=protocol, doubled=True)
                continue
            status = bus.ping(device, TRIES)
        if status is not None:
            yield _examine(bus, status)


def _is_doubled(bus: DynamixelBus, requests: Iterable[Request]) -> bool:
    """Tell whether two devices reply to one of some requests to a single id.

    Their replies overlap, which damages them, or one follows the other, in every exchange. One
    whole reply, and then silence, is that of one device: what came before was late, or came twice.
    """
    with using_margin((bus,), CONFIRM_MARGIN):
        return any(
            all(_is_crowded(bus, request) for _ in range(GARBLED_REPLIES)) for request in requests
        )


def _is_crowded(bus: DynamixelBus, request: Request) -> bool:
    """Return whether more, or other bytes than one whole reply come on a line that was silent."""
    bus.await_silence()
    parser = bus.wire.parse_replies()
    *_, heard = [b"", *bus.listen(request)]
    found = parser.feed(heard.removeprefix(request.frame))  # an adapter may echo what is sent
    return bool(len(found) > 1 or parser.damaged or parser.noise or parser.pending)


def _count_garbled_bytes(bus: DynamixelBus, before: BusStatistics) -> int:
    """Count the bytes received since, unless an adapter only echoed what was sent."""
    passed = bus.statistics - before
    return 0 if passed.bytes_in == passed.bytes_out else passed.bytes_in


def _examine(bus: DynamixelBus, status: Status, *, is_suspect: bool = False) -> FoundDevice:
    """Read what a device measures; of a suspect one, find out whether it is two."""
    number, firmware = read_identity(status)
    baud = bus.port.baud
    try:
        table = table_for(number, firmware, bus.wire)
    except UnknownModelError:
        return FoundDevice(
            id=status.id, baud=baud, number=number, firmware=firmware, protocol=bus.wire.name
        )
    before = replace(bus.statistics)
    values = read_items(bus, status.id, table, ("realtime_tick", *MEASURED))
    is_suspect = is_suspect or (values is None and _count_garbled_bytes(bus, before) > 0)
    # What two devices of one id answer differently, or at different times.
    reads = [bus.group({status.id: table[n].span}) for n in TELLTALES if n in table]
    is_doubled = is_suspect and _is_doubled(bus, [bus.ask_identity(status.id), *reads])
    if values is None and not is_doubled:
        with using_margin((bus,), CONFIRM_MARGIN):
            values = read_items(bus, status.id, table, MEASURED)
    return FoundDevice(
        id=status.id,
        baud=baud,
        number=number,
        table=table,
        firmware=firmware,
        values=values or {},
        protocol=table.wire.name,
        doubled=is_doubled,
    )


# IMUs -------------------------------------------------------------------------------------------


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
