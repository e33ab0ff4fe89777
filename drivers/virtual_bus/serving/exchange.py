"""One request and its answers, with the faults that befall them."""

from __future__ import annotations

from drivers.dynamixel.protocol2 import BROADCAST, Damaged, Instruction, Packet
from drivers.virtual_bus.serving.fault_injector import Faults
from drivers.virtual_bus.serving.instruction_reader import Request
from drivers.virtual_bus.serving.interfaces import Devices, WireStatistics
from drivers.virtual_bus.serving.pseudo_terminal import Wire
from drivers.virtual_bus.serving.wire_faults import Sending

GROUP_READS = (
    Instruction.SYNC_READ,
    Instruction.FAST_SYNC_READ,
    Instruction.BULK_READ,
    Instruction.FAST_BULK_READ,
)


class Exchange:
    """Puts requests to the devices; knows nothing of time."""

    def __init__(
        self,
        devices: Devices,
        faults: Faults,
        statistics: WireStatistics,
        *,
        strict_stuffing: bool = False,
    ) -> None:
        """Put requests to devices, and count."""
        self._devices, self._faults = devices, faults
        self._strict_stuffing = strict_stuffing
        self.statistics = statistics

    def answer(self, request: Request) -> list[Sending]:
        """Return what goes to the client, in the order of the wire."""
        line, statistics = self._faults.line, self.statistics
        sendings: list[Sending] = []
        if line.echoes():
            sendings.append(Sending(BROADCAST, 0.0, _frame_of(request.item)))
        heard = self._hear(request)
        answers = [a for item in heard for a in self._devices.handle(item, baud=request.baud)]
        statistics.answers += len(answers)
        statistics.unanswered += not answers and asks_for_answer(request.item)
        if line.quiet:
            return sendings + [Sending(a.device, a.delay, a.data) for a in answers]
        for answer in answers:
            sendings += line.disturb_answer(answer)
        return sendings

    def hand_over(self, wire: Wire, data: bytes, baud: int) -> None:
        """Give the client bytes that were sent at a rate [bit/s].

        Lost are the bytes that it has no room for, and all if it has changed its rate since.
        """
        if wire.plugged and wire.baud != baud:
            self.statistics.missed += len(data)
            return
        taken = wire.write(data) if data else 0
        self.statistics.bytes_out += taken
        self.statistics.overflow += len(data) - taken

    def _hear(self, request: Request) -> list[Packet | Damaged]:
        if self._faults.silent:
            self._faults.note_silenced()
            return []
        if all(device.baud != request.baud for device in self._devices.devices):
            self.statistics.wrong_baud += 1
            return []
        if request.unstuffed and self._strict_stuffing:
            return []
        return self._faults.line.disturb_request(request.item)


def asks_for_answer(item: Packet | Damaged) -> bool:
    """Tell whether a client will wait for an answer."""
    if isinstance(item, Damaged):
        return True
    if item.instruction in GROUP_READS or item.instruction == Instruction.PING:
        return True
    return item.id != BROADCAST and item.instruction != Instruction.ACTION


def _frame_of(item: Packet | Damaged) -> bytes:
    return item.encode() if isinstance(item, Packet) else item.frame
