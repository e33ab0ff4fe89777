"""Finds servos of Protocol 1.0 and of Feetech's, which share a frame: pings one id at a time."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

from drivers.dynamixel import protocol2
from drivers.dynamixel.bus import ANSWER_MARGIN, TRIES, DynamixelBus
from drivers.dynamixel.control_table import UnknownModelError, table_for
from drivers.dynamixel.protocol1 import FEETECH, PROTOCOL_1
from drivers.dynamixel.protocol2 import Damaged, Status, read_identity
from drivers.dynamixel.requests import Request
from drivers.dynamixel.robot_ports import using_margin
from drivers.dynamixel.wire import AT_ID, FIRST, PROTOCOL_2, WIRES, Wire, decode_identity
from drivers.errors import SetupError
from drivers.serial_port import read_latency_timer

ALIKE = (PROTOCOL_1, FEETECH)
"""Protocols whose frames are the same."""
LATENCY_MARGIN = 0.002  # s beyond an adapter's latency timer
SWEPT = range(PROTOCOL_1.max_id + 1)
"""Ids that are pinged where none is named."""
READ_MARGIN = 0.05  # s for the read of an id that was heard; what is later than that is silent
ROUNDS = 2  # of ids that are silent, so that one damaged or late reply hides no servo


def choose_wires(protocol: str | None) -> tuple[Wire, ...]:
    """Return the protocols in which to look for servos: that of a name, or all without one."""
    if protocol is None:
        return tuple(WIRES.values())
    if protocol not in WIRES:
        raise SetupError(f"protocol is '{protocol}', expected {', '.join(WIRES)}")
    return (WIRES[protocol],)


def sweep(bus: DynamixelBus, wires: Sequence[Wire], ids: Iterable[int] | None = None) -> list[int]:
    """Find the ids, all or some, that reply in one of the protocols; the bus speaks it afterwards.

    Only pings and reads are sent: nothing changes.
    """
    found = list_speakers(bus, wires, ids)
    if unclear := [device for device, wire in found.items() if wire is None]:
        raise SetupError(
            f"port {bus.port.path}: the servo of id {unclear[0]} may be a Dynamixel of Protocol "
            "1.0 or a Feetech: --protocol 1.0 or --protocol feetech says which"
        )
    spoken = {device: wire for device, wire in found.items() if wire is not None}
    bus.wire = next(iter(spoken.values()), PROTOCOL_2)
    if len({wire.name for wire in spoken.values()}) > 1:
        listed = ", ".join(f"{device} ({wire.name})" for device, wire in spoken.items())
        raise SetupError(
            f"port {bus.port.path}: servos {listed} speak two protocols, expected one: "
            "--protocol names one of them"
        )
    return list(spoken)


def list_speakers(
    bus: DynamixelBus, wires: Sequence[Wire], ids: Iterable[int] | None = None
) -> dict[int, Wire | None]:
    """List the ids, all or some, that reply in one of the protocols; None if it may be either.

    Silent ids are pinged again, but not where nothing at all came. The bus speaks Protocol 2.0
    afterwards.
    """
    wanted = [wire for wire in ALIKE if wire in wires]
    if not wanted:
        return {}
    bus.wire = wanted[0]
    latency = (read_latency_timer(bus.port.path) or 0) * 1e-3
    margin = max(ANSWER_MARGIN, latency + LATENCY_MARGIN)
    found: dict[int, Wire | None] = {}
    sought, before = list(SWEPT if ids is None else ids), replace(bus.statistics)
    try:
        with using_margin([bus], margin if ids is None else max(margin, bus.answer_margin)):
            for _ in range(ROUNDS):
                for device in [device for device in sought if device not in found]:
                    found |= _identify(bus, device, wanted)
                traffic = bus.statistics - before
                if ids is None and not (traffic.bytes_in or traffic.stale):
                    break
    finally:
        bus.wire = PROTOCOL_2
    return dict(sorted(found.items()))


def _identify(bus: DynamixelBus, device: int, wanted: Sequence[Wire]) -> dict[int, Wire | None]:
    """Find what a device speaks, by its id; nothing if it is silent.

    At Status Return Level 0 a servo of Protocol 1.0 replies to pings alone, a Feetech to reads too.
    """
    ping = bus.ask(protocol2.ping(device))
    heard = _hear(bus, ping, device)
    if not heard:
        return {}
    status = _read_first(bus, device)
    if status is not None:
        return {device: _choose(status, wanted)}
    frames = bus.wire.parse_replies().feed(heard)
    replies = [frame.id for frame in frames if not isinstance(frame, Damaged)]
    bus.statistics.damaged += not replies
    is_pong = replies == [device] and heard != ping.frame  # which an adapter may echo
    return {device: PROTOCOL_1} if is_pong and PROTOCOL_1 in wanted else {}


def _read_first(bus: DynamixelBus, device: int) -> Status | None:
    request = bus.ask(protocol2.read(device, FIRST), FIRST.length)
    with using_margin([bus], max(READ_MARGIN, bus.answer_margin)):
        return bus.request(request, TRIES).get(device)


def _hear(bus: DynamixelBus, request: Request, device: int) -> bytes:
    """Return what comes after a request, up to the first frame of a device."""
    heard = b""
    for heard in bus.listen(request):
        if any(packet.id == device for packet in bus.wire.parse_replies().feed(heard)):
            break
    return heard


def _choose(status: Status, wanted: Sequence[Wire]) -> Wire | None:
    """Choose the protocol in which a reply names its own id, and a model that is known if any."""
    naming = [wire for wire in wanted if _names_itself(status, wire)]
    knowing = [wire for wire in naming if _is_known(status, wire)]
    for fitting in (wanted, knowing, naming):
        if len(fitting) == 1:
            return fitting[0]
    return None


def _names_itself(status: Status, wire: Wire) -> bool:
    data = status.data
    return len(data) >= FIRST.length and data[AT_ID[wire.name]] == status.id


def _is_known(status: Status, wire: Wire) -> bool:
    number, firmware = read_identity(decode_identity(wire, status))
    try:
        table_for(number, firmware, wire)
    except UnknownModelError:
        return False
    return True
