"""Faults of the bytes between a client and the devices."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace
from enum import Enum
from typing import NamedTuple

import numpy as np

from drivers.dynamixel.protocol2 import MAX_ID, Damaged, FrameParser, Packet, Status
from drivers.virtual_bus.serving.interfaces import DeviceReply

LONGEST_NOISE = 8  # bytes


class LineFault(Enum):
    """A fault of one reply or of one request."""

    LOSE_REQUEST = "lose_request"
    """No device receives the instruction."""
    FLIP_REQUEST = "flip_request"
    """The devices receive an instruction with a flipped bit; a rate applies per byte."""
    ECHO = "echo"
    """The adapter returns the client's own instruction."""
    LOSE = "lose"
    """The reply is lost."""
    WRONG_ID = "wrong_id"
    """The reply carries another device's id."""
    FLIP = "flip"
    """The reply has a flipped bit; a rate applies per byte."""
    CUT = "cut"
    """The end of the reply is missing."""
    NOISE = "noise"
    """Random bytes precede the reply."""
    DUPLICATE = "duplicate"
    """The reply arrives twice."""
    SPLIT = "split"
    """The reply arrives in two parts with a pause between them."""
    LATE = "late"
    """The adapter holds the reply back."""


class Transmission(NamedTuple):
    """Bytes on their way to the client."""

    device: int
    delay: float
    """Silence on the wire before the first byte [s]."""
    data: bytes
    hold: float = 0.0
    """How long the adapter holds them back [s]."""


@dataclass
class _Order:
    """A counted order for one fault."""

    fault: LineFault
    device: int | None
    left: int


class LineFaults:
    """Applies faults to bytes, at rates and on order.

    Without rates no random number is drawn, so the effect of an order does not depend on earlier
    traffic.
    """

    late_by = 0.02
    """How long a late reply is held back [s]."""
    split_pause = 0.003
    """How long the second part of a split reply is held back [s]."""

    def __init__(self, rng: np.random.Generator) -> None:
        """Start without faults; ``rng`` draws them."""
        self.counts: Counter[str] = Counter()
        self._rng = rng
        self._rates: dict[LineFault, float] = {}
        self._orders: list[_Order] = []

    def set_rate(self, fault: LineFault, rate: float) -> None:
        """Set the share of replies, requests or bytes that a fault affects, 0 to 1."""
        if not 0.0 <= rate <= 1.0:
            raise ValueError(f"rate of {fault.value} is {rate}, expected 0 to 1")
        self._rates.pop(fault, None)
        if rate > 0.0:
            self._rates[fault] = rate

    def order(self, fault: LineFault, device: int | None = None, count: int = 1) -> None:
        """Apply a fault to the next replies (of one device, or of any) or requests."""
        self._orders.append(_Order(fault, device, count))

    @property
    def quiet(self) -> bool:
        """Whether there is neither a rate nor an order."""
        return not self._rates and not self._orders

    def disturb_request(self, item: Packet | Damaged) -> list[Packet | Damaged]:
        """Return what the devices receive of an instruction."""
        if self.quiet:
            return [item]
        if self._strikes(LineFault.LOSE_REQUEST):
            return []
        frame = item.encode() if isinstance(item, Packet) else item.frame
        flipped = self._flip(LineFault.FLIP_REQUEST, frame)
        return [item] if flipped == frame else FrameParser().feed(flipped)

    def strikes_echo(self) -> bool:
        """Return whether the adapter returns this request."""
        return not self.quiet and self._strikes(LineFault.ECHO)

    def disturb_reply(self, reply: DeviceReply) -> list[Transmission]:
        """Return what the client receives of a reply."""
        device = reply.device
        transmission = Transmission(device, reply.delay, reply.data)
        if self.quiet:
            return [transmission]
        if self._strikes(LineFault.LOSE, device):
            return []
        data = transmission.data
        if self._strikes(LineFault.WRONG_ID, device):
            data = _rename(data, device)
        data = self._flip(LineFault.FLIP, data, device)
        if self._strikes(LineFault.CUT, device):
            data = data[: self._rng.integers(len(data))]
        if self._strikes(LineFault.NOISE, device):
            data = self._rng.bytes(int(self._rng.integers(1, LONGEST_NOISE + 1))) + data
        if self._strikes(LineFault.DUPLICATE, device):
            data += data
        parts = [transmission._replace(data=data)]
        if self._strikes(LineFault.SPLIT, device) and len(data) > 1:
            at = int(self._rng.integers(1, len(data)))
            pause = self.split_pause
            parts = [
                transmission._replace(data=data[:at]),
                Transmission(device, 0.0, data[at:], pause),
            ]
        if self._strikes(LineFault.LATE, device):
            parts = [part._replace(hold=part.hold + self.late_by) for part in parts]
        return parts

    def _strikes(self, fault: LineFault, device: int | None = None) -> bool:
        rate = self._rates.get(fault, 0.0)
        struck = self._take_order(fault, device) or (rate > 0.0 and self._rng.random() < rate)
        self.counts[fault.value] += struck
        return struck

    def _flip(self, fault: LineFault, data: bytes, device: int | None = None) -> bytes:
        """Flip one bit of each byte at the rate, or one bit on order."""
        rate, size = self._rates.get(fault, 0.0), len(data)
        at = np.flatnonzero(self._rng.random(size) < rate) if rate > 0.0 else np.zeros(0, int)
        if self._take_order(fault, device):
            at = np.append(at, self._rng.integers(size))
        if not len(at):
            return data
        self.counts[fault.value] += 1
        flipped = np.frombuffer(data, np.uint8).copy()
        np.bitwise_xor.at(flipped, at, 1 << self._rng.integers(0, 8, len(at)).astype(np.uint8))
        return flipped.tobytes()

    def _take_order(self, fault: LineFault, device: int | None) -> bool:
        for order in self._orders:
            if order.fault is fault and order.device in (None, device):
                order.left -= 1
                if not order.left:
                    self._orders.remove(order)
                return True
        return False


def _rename(data: bytes, device: int) -> bytes:
    """Replace the id of a status and update its CRC; of a fast part, only the id."""
    other = (device + 1) % (MAX_ID + 1)
    items = FrameParser().feed(data)
    if len(items) == 1 and isinstance(items[0], Packet) and items[0].id == device:
        return replace(Status.from_packet(items[0]), id=other).encode()
    at = data.find(bytes((device,)), 1)
    return data if at < 0 else data[:at] + bytes((other,)) + data[at + 1 :]
