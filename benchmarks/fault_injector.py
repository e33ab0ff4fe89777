"""Injects faults into a virtual bus: into the bytes between client and devices, and beyond."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import Enum
from operator import methodcaller
from typing import Any

import numpy as np

from drivers.dynamixel.protocol2 import MAX_ID, Damaged, Packet
from drivers.dynamixel.wire import PROTOCOL_2, Wire, encode_item
from drivers.errors import DriverError
from drivers.virtual_bus.devices.chain import Reply
from drivers.virtual_bus.serving.exchange import Line

LONGEST_NOISE = 8  # bytes


class LineFault(Enum):
    """A fault of one reply or of one request."""

    LOSE_REQUEST = "lose_request"  # no device receives the instruction
    FLIP_REQUEST = "flip_request"  # devices receive a flipped bit; a rate applies per byte
    ECHO = "echo"  # the adapter returns the client's own instruction
    LOSE = "lose"  # the reply is lost
    WRONG_ID = "wrong_id"  # the reply carries another device's id
    FLIP = "flip"  # the reply has a flipped bit; a rate applies per byte
    CUT = "cut"  # the end of the reply is missing
    NOISE = "noise"  # random bytes precede the reply
    DUPLICATE = "duplicate"  # the reply arrives twice
    SPLIT = "split"  # the reply arrives in two parts with a pause between them
    LATE = "late"  # the adapter holds the reply back


@dataclass
class _Pending:
    """A fault for a number of coming replies or requests."""

    fault: LineFault
    device: int | None
    left: int


class LineFaults(Line):
    """Applies faults to bytes: at rates, or to the next replies or requests.

    Without rates no random number is drawn, so the effect of `strike_next` does not depend on
    earlier traffic.
    """

    late_by = 0.02
    """How long a late reply is held back [s]."""
    split_pause = 0.003
    """How long the second part of a split reply is held back [s]."""

    def __init__(self, rng: np.random.Generator, wire: Wire = PROTOCOL_2) -> None:
        """Start without faults; ``rng`` draws them."""
        self._rng, self._wire = rng, wire
        self._rates: dict[LineFault, float] = {}
        self._pending: list[_Pending] = []

    def set_rate(self, fault: LineFault, rate: float) -> None:
        """Set the share of replies, requests or bytes that a fault affects, 0 to 1."""
        if not 0.0 <= rate <= 1.0:
            raise ValueError(f"rate of {fault.value} is {rate}, expected 0 to 1")
        self._rates.pop(fault, None)
        if rate > 0.0:
            self._rates[fault] = rate

    def strike_next(self, fault: LineFault, device: int | None = None, count: int = 1) -> None:
        """Apply a fault to the next replies (of one device, or of any) or requests."""
        self._pending.append(_Pending(fault, device, count))

    @property
    def quiet(self) -> bool:
        """Return whether no fault can strike."""
        return not self._rates and not self._pending

    def disturb_request(self, item: Packet | Damaged) -> list[Packet | Damaged]:
        """Return an instruction as the devices receive it."""
        if self.quiet:
            return [item]
        if self._strikes(LineFault.LOSE_REQUEST):
            return []
        frame = encode_item(self._wire, item)
        flipped = self._flip(LineFault.FLIP_REQUEST, frame)
        return [item] if flipped == frame else self._wire.parse_instructions().feed(flipped)

    def strikes_echo(self) -> bool:
        """Return whether the adapter returns this request."""
        return not self.quiet and self._strikes(LineFault.ECHO)

    def disturb_reply(self, reply: Reply) -> list[Reply]:
        """Return a reply as the client receives it."""
        device, data = reply.device, reply.data
        if self.quiet:
            return [reply]
        if self._strikes(LineFault.LOSE, device):
            return []
        if self._strikes(LineFault.WRONG_ID, device):
            data = _rename(self._wire, data, device)
        data = self._flip(LineFault.FLIP, data, device)
        if self._strikes(LineFault.CUT, device):
            data = data[: self._rng.integers(len(data))]
        if self._strikes(LineFault.NOISE, device):
            data = self._rng.bytes(int(self._rng.integers(1, LONGEST_NOISE + 1))) + data
        if self._strikes(LineFault.DUPLICATE, device):
            data += data
        parts = [reply._replace(data=data)]
        if self._strikes(LineFault.SPLIT, device) and len(data) > 1:
            at = int(self._rng.integers(1, len(data)))
            second = Reply(device, 0.0, data[at:], self.split_pause)
            parts = [reply._replace(data=data[:at]), second]
        if self._strikes(LineFault.LATE, device):
            parts = [part._replace(hold=part.hold + self.late_by) for part in parts]
        return parts

    def _strikes(self, fault: LineFault, device: int | None = None) -> bool:
        rate = self._rates.get(fault, 0.0)
        return self._take_pending(fault, device) or (rate > 0.0 and self._rng.random() < rate)

    def _flip(self, fault: LineFault, data: bytes, device: int | None = None) -> bytes:
        """Flip one bit of each byte at the rate, and one bit if a fault is pending."""
        rate, size = self._rates.get(fault, 0.0), len(data)
        at = np.flatnonzero(self._rng.random(size) < rate) if rate > 0.0 else np.zeros(0, int)
        if self._take_pending(fault, device):
            at = np.append(at, self._rng.integers(size))
        if not len(at):
            return data
        flipped = np.frombuffer(data, np.uint8).copy()
        np.bitwise_xor.at(flipped, at, 1 << self._rng.integers(0, 8, len(at)).astype(np.uint8))
        return flipped.tobytes()

    def _take_pending(self, fault: LineFault, device: int | None) -> bool:
        for pending in self._pending:
            if pending.fault is fault and pending.device in (None, device):
                pending.left -= 1
                if not pending.left:
                    self._pending.remove(pending)
                return True
        return False


def _rename(wire: Wire, data: bytes, device: int) -> bytes:
    """Replace the id of a status and update its CRC; of a fast part, only the id."""
    other = (device + 1) % (MAX_ID + 1)
    items = wire.parse_replies().feed(data)
    if len(items) == 1 and isinstance(items[0], Packet) and items[0].id == device:
        return wire.encode_status(replace(wire.decode_status(items[0]), id=other))
    at = data.find(bytes((device,)), 1)
    return data if at < 0 else data[:at] + bytes((other,)) + data[at + 1 :]


def _refuse(fault: str, device: int | None, expected: str) -> DriverError:
    where = "" if device is None else f" of id {device}"
    return DriverError(f"fault '{fault}'{where} cannot be injected: expected {expected}")


class FaultInjector:
    """Injects faults, between two instructions; thread-safe."""

    def __init__(self, bus: Any, rng: np.random.Generator) -> None:
        """Inject faults into a `VirtualBus`; ``rng`` draws the random ones."""
        self.line = LineFaults(rng, bus.devices.wire)
        self._bus = bus
        bus.line = self.line

    # Bytes on the wire ---------------------------------------------------------------------

    def set_rate(self, fault: LineFault, rate: float) -> None:
        """Apply a wire fault to a share of all replies, requests or bytes, 0 to 1."""
        self._bus.call(lambda: self.line.set_rate(fault, rate))

    def strike_next(self, fault: LineFault, device: int | None = None, count: int = 1) -> None:
        """Apply a wire fault to the next replies (of one device, or of any) or requests."""
        self._bus.call(lambda: self.line.strike_next(fault, device, count))

    def silence(self, silent: bool = True) -> None:
        """Disconnect the adapter from all devices: no instruction is executed."""
        self._bus.call(lambda: setattr(self.line, "silent", silent))

    # Devices -------------------------------------------------------------------------------

    def kill(self, device: int) -> None:
        """Disconnect a device: it neither receives nor replies, and carries on as before."""
        self._change("kill", device, lambda found: setattr(found, "alive", False))

    def revive(self, device: int) -> None:
        """Reconnect a device."""
        self._change("revive", device, lambda found: setattr(found, "alive", True))

    def reboot(self, device: int) -> None:
        """Restart a servo: RAM at its defaults, torque off."""
        self._change("reboot", device, methodcaller("reboot"))

    def trip(self, device: int, error: int) -> None:
        """Set hardware error bits of a servo (`HardwareError`)."""
        self._change("trip", device, methodcaller("trip", error))

    def heat(self, device: int, temperature: float) -> None:
        """Set the temperature of a servo [°C]; from there it follows the thermal model."""
        self._change("heat", device, lambda _: self._bus.physics.heat(device, temperature))

    def freeze_imu(self, frozen: bool = True) -> None:
        """Make every IMU repeat its last measurement."""

        def freeze() -> None:
            boards: list[Any] = [d for d in self._bus.devices.devices if hasattr(d, "frozen")]
            if not boards:
                raise _refuse("freeze_imu", None, "a bus with an IMU")
            for board in boards:
                board.frozen = frozen

        self._bus.call(freeze)

    # Supply and port -----------------------------------------------------------------------

    def sag(self, voltage: float) -> None:
        """Set the battery voltage [V]."""
        self._bus.call(lambda: self._bus.physics.sag(voltage))

    def unplug(self) -> None:
        """Unplug the adapter: the port disappears."""
        self._bus.unplug()

    def replug(self) -> None:
        """Plug the adapter in: a new port under the same path."""
        self._bus.plug()

    def _change(self, fault: str, device: int, change: Callable[[Any], object]) -> None:
        """Change all devices of an id in a way that may be a servo's alone."""

        def act() -> None:
            devices = self._bus.devices.devices
            found = [each for each in devices if each.id == device]
            if not found:
                ids = ", ".join(str(each.id) for each in devices)
                raise _refuse(fault, device, f"one of the ids {ids}")
            try:
                for each in found:
                    change(each)
            except (AttributeError, ValueError) as error:
                raise _refuse(fault, device, "a servo") from error

        self._bus.call(act)
