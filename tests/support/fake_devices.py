"""Devices small enough to print: plain memory that answers ping, read, write and groups."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass, field

from fast_status import encode_fast_status

from drivers.dynamixel.protocol2 import (
    BROADCAST,
    Damaged,
    Instruction,
    Packet,
    Status,
)
from drivers.dynamixel.wire import PROTOCOL_2
from drivers.virtual_bus.devices.chain import CycleEnd, Reply


@dataclass
class FakeDevice:
    id: int
    baud: int = 1_000_000
    alive: bool = True
    rebooted: int = 0
    errors: int = 0
    memory: bytearray = field(default_factory=lambda: bytearray(range(256)))

    def reboot(self) -> None:
        self.rebooted += 1

    def trip(self, error: int) -> None:
        self.errors |= error


class FakeDevices:
    def __init__(self, ids: Sequence[int], *, delay: float = 0.0, baud: int = 1_000_000) -> None:
        self.wire, self.cycle_end = PROTOCOL_2, CycleEnd.of(())
        self.devices = [FakeDevice(i, baud) for i in ids]
        self._by_id = {device.id: device for device in self.devices}
        self.delay = delay
        self.heard: list[Packet | Damaged] = []
        self.now = 0.0

    def advance(self, now: float) -> None:
        self.now = now

    def device(self, device_id: int) -> FakeDevice:
        return self._by_id[device_id]

    def handle(self, item: Packet | Damaged, *, baud: int | None = None) -> list[Reply]:
        assert baud is None or baud in {device.baud for device in self.devices}
        self.heard.append(item)
        if isinstance(item, Damaged):
            return []
        if item.instruction == Instruction.SYNC_WRITE:
            address, length = struct.unpack_from("<HH", item.params)
            for at in range(4, len(item.params), length + 1):
                memory = self.device(item.params[at]).memory
                memory[address : address + length] = item.params[at + 1 : at + 1 + length]
            return []
        if item.instruction in (Instruction.SYNC_READ, Instruction.FAST_SYNC_READ):
            address, length = struct.unpack_from("<HH", item.params)
            statuses = [
                Status(i, 0, bytes(self.device(i).memory[address : address + length]))
                for i in item.params[4:]
                if i in self._by_id and self.device(i).alive
            ]
            if item.instruction == Instruction.FAST_SYNC_READ:
                return self._cut(encode_fast_status(statuses), statuses)
            return [Reply(s.id, self.delay, s.encode()) for s in statuses]
        answers = [self._answer(d, item) for d in self.devices if item.id in (d.id, BROADCAST)]
        return [Reply(s.id, self.delay, s.encode()) for s in answers if s]

    def _answer(self, device: FakeDevice, item: Packet) -> Status | None:
        if not device.alive:
            return None
        if item.instruction == Instruction.PING:
            return Status(device.id, 0, bytes((0xFC, 0x03, 46)))
        if item.instruction == Instruction.READ:
            address, length = struct.unpack("<HH", item.params)
            return Status(device.id, 0, bytes(device.memory[address : address + length]))
        if item.instruction == Instruction.WRITE:
            address = struct.unpack_from("<H", item.params)[0]
            device.memory[address : address + len(item.params) - 2] = item.params[2:]
            return Status(device.id) if item.id != BROADCAST else None
        return None

    def _cut(self, frame: bytes, statuses: list[Status]) -> list[Reply]:
        pieces, at = [], 0
        for k, status in enumerate(statuses):
            end = at + (8 if k == 0 else 0) + 4 + len(status.data)
            pieces.append(Reply(status.id, self.delay if k == 0 else 0.0, frame[at:end]))
            at = end
        return pieces
