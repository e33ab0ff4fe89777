"""What can happen to bytes between a client and the devices."""

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
    """One mishap of one answer, or of one request."""

    LOSE_REQUEST = "lose_request"
    """No device hears the instruction."""
    FLIP_REQUEST = "flip_request"
    """The devices hear an instruction with a flipped bit; as a rate, in each byte."""
    ECHO = "echo"
    """The adapter hands the client its own instruction."""
    LOSE = "lose"
    """The answer is gone."""
    WRONG_ID = "wrong_id"
    """The answer names another device."""
    FLIP = "flip"
    """The answer has a flipped bit; as a rate, in each byte."""
    CUT = "cut"
    """The answer's end is gone."""
    NOISE = "noise"
    """Random bytes come before the answer."""
    DUPLICATE = "duplicate"
    """The answer comes twice."""
    SPLIT = "split"
    """The answer comes in two parts, with a pause between them."""
    LATE = "late"
    """The adapter keeps the answer back."""


class Sending(NamedTuple):
    """Bytes on their way to the client."""

    device: int
    delay: float
    """Silence on the wire before the first byte [s]."""
    data: bytes
    hold: float = 0.0
    """How long the adapter keeps them back [s]."""


@dataclass
class _Order:
    """Mishaps that were asked for one by one."""

    fault: LineFault
    device: int | None
    left: int


class LineFaults:
    """Makes mishaps: by rates, and on order.

    With no rate set it draws no random number, so what is on order does not depend on how
    much has passed before.
    """

    late_by = 0.02
    """How long a late answer is kept back [s]."""
    split_pause = 0.003
    """How long the second part of a split answer is kept back [s]."""

    def __init__(self, rng: np.random.Generator) -> None:
        """Make mishaps from a random source."""
        self.counts: Counter[str] = Counter()
        self._rng = rng
        self._rates: dict[LineFault, float] = {}
        self._orders: list[_Order] = []

    def set_rate(self, fault: LineFault, rate: float) -> None:
        """Set the share of answers, requests or bytes that a mishap takes, 0 to 1."""
        if not 0.0 <= rate <= 1.0:
            raise ValueError(f"rate of {fault.value}: {rate}, allowed 0 to 1")
        self._rates.pop(fault, None)
        if rate > 0.0:
            self._rates[fault] = rate

    def order(self, fault: LineFault, device: int | None = None, count: int = 1) -> None:
        """Let a mishap take the next answers of a device, or of any; or the next requests."""
        self._orders.append(_Order(fault, device, count))

    @property
    def quiet(self) -> bool:
        """Tell whether no mishap can happen now."""
        return not self._rates and not self._orders

    def disturb_request(self, item: Packet | Damaged) -> list[Packet | Damaged]:
        """Return what the devices hear of an instruction."""
        if self.quiet:
            return [item]
        if self._strikes(LineFault.LOSE_REQUEST):
            return []
        frame = item.encode() if isinstance(item, Packet) else item.frame
        flipped = self._flip(LineFault.FLIP_REQUEST, frame)
        return [item] if flipped == frame else FrameParser().feed(flipped)

    def echoes(self) -> bool:
        """Tell whether the adapter hands this request back."""
        return not self.quiet and self._strikes(LineFault.ECHO)

    def disturb_answer(self, answer: DeviceReply) -> list[Sending]:
        """Return what the client gets of an answer."""
        device = answer.device
        sending = Sending(device, answer.delay, answer.data)
        if self.quiet:
            return [sending]
        if self._strikes(LineFault.LOSE, device):
            return []
        data = sending.data
        if self._strikes(LineFault.WRONG_ID, device):
            data = _rename(data, device)
        data = self._flip(LineFault.FLIP, data, device)
        if self._strikes(LineFault.CUT, device):
            data = data[: self._rng.integers(len(data))]
        if self._strikes(LineFault.NOISE, device):
            data = self._rng.bytes(int(self._rng.integers(1, LONGEST_NOISE + 1))) + data
        if self._strikes(LineFault.DUPLICATE, device):
            data += data
        parts = [sending._replace(data=data)]
        if self._strikes(LineFault.SPLIT, device) and len(data) > 1:
            at = int(self._rng.integers(1, len(data)))
            pause = self.split_pause
            parts = [sending._replace(data=data[:at]), Sending(device, 0.0, data[at:], pause)]
        if self._strikes(LineFault.LATE, device):
            parts = [part._replace(hold=part.hold + self.late_by) for part in parts]
        return parts

    def _strikes(self, fault: LineFault, device: int | None = None) -> bool:
        rate = self._rates.get(fault, 0.0)
        struck = self._take_order(fault, device) or (rate > 0.0 and self._rng.random() < rate)
        self.counts[fault.value] += struck
        return struck

    def _flip(self, fault: LineFault, data: bytes, device: int | None = None) -> bytes:
        """Flip bits at the rate of each byte, or one on order."""
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
    """Give a status another id, with the CRC that fits; a part of a fast one only the id."""
    other = (device + 1) % (MAX_ID + 1)
    items = FrameParser().feed(data)
    if len(items) == 1 and isinstance(items[0], Packet) and items[0].id == device:
        return replace(Status.from_packet(items[0]), id=other).encode()
    at = data.find(bytes((device,)), 1)
    return data if at < 0 else data[:at] + bytes((other,)) + data[at + 1 :]
