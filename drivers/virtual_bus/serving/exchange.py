"""Exchange between a port and the devices behind it: instructions, replies, faults, time."""

from __future__ import annotations

from collections import deque

from drivers.dynamixel.protocol2 import BROADCAST, Damaged, Instruction, Packet
from drivers.dynamixel.wire import encode_item
from drivers.virtual_bus.devices.chain import Chain, Reply
from drivers.virtual_bus.serving.fault_injector import FaultInjector
from drivers.virtual_bus.serving.fault_schedule import FaultSchedule
from drivers.virtual_bus.serving.instruction_reader import ReceivedInstruction, WireStatistics
from drivers.virtual_bus.serving.physics import Physics
from drivers.virtual_bus.serving.pseudo_terminal import PseudoTerminal

GROUP_READS = (
    Instruction.SYNC_READ,
    Instruction.FAST_SYNC_READ,
    Instruction.BULK_READ,
    Instruction.FAST_BULK_READ,
)


class Exchange:
    """Passes instructions to devices, advances physics, and injects scheduled faults."""

    def __init__(
        self,
        devices: Chain,
        physics: Physics,
        faults: FaultInjector,
        schedule: FaultSchedule | None = None,
        *,
        advances_time: bool = True,
    ) -> None:
        """Connect devices and physics; the parameters are those of `VirtualBus`."""
        self._devices, self._physics, self._faults = devices, physics, faults
        self._scheduled = deque(schedule.plan_actions() if schedule else ())
        self._advances_time = advances_time
        self.statistics = WireStatistics()
        self.wire = devices.wire
        """Protocol of the bus."""
        self.cycle_end = devices.cycle_end
        """What ends a control period in lock-step."""

    @property
    def time(self) -> float:
        """Return the bus time that physics and devices have reached [s]."""
        return self._physics.time

    def pass_until(self, to: float) -> None:
        """Advance to a bus time [s], or to the last physics step before it."""
        if not self._advances_time:
            return
        while self._scheduled and self._scheduled[0][0] <= to:
            at, act = self._scheduled.popleft()
            self._physics.advance(at)
            act(self._faults)
        self._physics.advance(to)

    def pass_period(self) -> None:
        """Advance by one control period, then inject the faults that came due in it."""
        if not self._advances_time:
            return
        self._physics.pass_period()
        while self._scheduled and self._scheduled[0][0] <= self.time:
            self._scheduled.popleft()[1](self._faults)

    def run(self, request: ReceivedInstruction) -> list[Reply]:
        """Execute an instruction; return the replies to the client, in their order on the wire."""
        line, statistics = self._faults.line, self.statistics
        echo = (
            [Reply(BROADCAST, 0.0, encode_item(self.wire, request.item))]
            if line.strikes_echo()
            else []
        )
        received = self._pass_on(request)
        replies = [r for item in received for r in self._devices.handle(item, baud=request.baud)]
        statistics.answers += len(replies)
        statistics.unanswered += not replies and expects_reply(request.item)
        return echo + [part for reply in replies for part in line.disturb_reply(reply)]

    def deliver(self, wire: PseudoTerminal, data: bytes, baud: int) -> None:
        """Deliver bytes that were sent at a baud rate [bit/s] to the client.

        Bytes are lost when its queue is full or when it has changed its rate since.
        """
        if wire.plugged and wire.baud != baud:
            self.statistics.missed += len(data)
            return
        taken = wire.write(data) if data else 0
        self.statistics.bytes_out += taken
        self.statistics.overflow += len(data) - taken

    def _pass_on(self, request: ReceivedInstruction) -> list[Packet | Damaged]:
        if self._faults.silent:
            self._faults.count_silenced()
            return []
        if all(device.baud != request.baud for device in self._devices.devices):
            self.statistics.wrong_baud += 1
            return []
        return self._faults.line.disturb_request(request.item)


def expects_reply(item: Packet | Damaged) -> bool:
    """Return whether a client waits for a reply."""
    if isinstance(item, Damaged):
        return True
    if item.instruction in GROUP_READS or item.instruction == Instruction.PING:
        return True
    return item.id != BROADCAST and item.instruction != Instruction.ACTION
