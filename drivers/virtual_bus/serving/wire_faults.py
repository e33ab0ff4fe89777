"""Faults of the bytes between a client and the devices."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np

from drivers.dynamixel.protocol2 import MAX_ID, Damaged, Packet
from drivers.dynamixel.wire import PROTOCOL_2, Wire, encode_item
from drivers.virtual_bus.devices.chain import Reply

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


@dataclass
class _Pending:
    """A fault for a number of coming replies or requests."""

    fault: LineFault
    device: int | None
    left: int


class LineFaults:
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
        self.counts: Counter[str] = Counter()
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
        struck = self._take_pending(fault, device) or (rate > 0.0 and self._rng.random() < rate)
        self.counts[fault.value] += struck
        return struck

    def _flip(self, fault: LineFault, data: bytes, device: int | None = None) -> bytes:
        """Flip one bit of each byte at the rate, and one bit if a fault is pending."""
        rate, size = self._rates.get(fault, 0.0), len(data)
        at = np.flatnonzero(self._rng.random(size) < rate) if rate > 0.0 else np.zeros(0, int)
        if self._take_pending(fault, device):
            at = np.append(at, self._rng.integers(size))
        if not len(at):
            return data
        self.counts[fault.value] += 1
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
