"""Fuzz the virtual servos with arbitrary instructions, checking invariants after each."""

from __future__ import annotations

import faulthandler
import math
import random
from collections.abc import Sequence
from dataclasses import dataclass, field

from drivers.dynamixel.control_table import Item, OperatingMode
from drivers.dynamixel.protocol2 import (
    BROADCAST,
    Damaged,
    FrameParser,
    Instruction,
    Packet,
    Reset,
    decode_fast_status,
)
from drivers.state import HardwareError
from drivers.virtual_bus.devices.board import VirtualBoard
from drivers.virtual_bus.devices.chain import Chain, Reply
from drivers.virtual_bus.devices.device import (
    Quirks,
    ReadGap,
    VirtualDevice,
)
from drivers.virtual_bus.devices.sensors import Measured
from drivers.virtual_bus.devices.servo import VirtualServo

HANG = 60.0  # s that one chain's share may take before it counts as a hang
PACKETS_PER_CHAIN = 2000
MODELS = ("XM430-W350", "XM430-W350", "XM540-W270", "XL430-W250", "XC330-M288", "2XC430-W250")
FIRMWARES = (38, 44, 45, 46, 52)
WRITES = (Instruction.WRITE, Instruction.REG_WRITE, Instruction.SYNC_WRITE, Instruction.BULK_WRITE)
FAST = (Instruction.FAST_SYNC_READ, Instruction.FAST_BULK_READ)
RESTORING = (Instruction.FACTORY_RESET, Instruction.REBOOT)
LIMITED = (
    ("goal_pwm", "pwm_limit"),
    ("goal_current", "current_limit"),
    ("goal_velocity", "velocity_limit"),
)


@dataclass
class ChainTally:
    """What came of fuzzing the virtual servos."""

    packets: int = 0
    bytes: int = 0
    answers: int = 0
    changes: int = 0
    """Packets after which a device's registers were not as before."""
    violations: list[str] = field(default_factory=list)

    @property
    def has_failed(self) -> bool:
        """Return whether a register held what no write may put there."""
        return bool(self.violations)


def fuzz_chain(rng: random.Random, size: int) -> ChainTally:
    """Send arbitrary packets to virtual devices; `size` counts the bytes of the packets."""
    tally = ChainTally()
    while tally.bytes < size and len(tally.violations) < 20:
        faulthandler.dump_traceback_later(HANG, exit=True)
        chain = build_chain(rng)
        before = [bytes(device.registers.memory) for device in chain.devices]
        now = 0.0
        for _ in range(PACKETS_PER_CHAIN):
            packet = draw_instruction(rng, chain.devices)
            locked = [is_under_torque(device) for device in chain.devices]
            ids = [device.id for device in chain.devices]
            answers = chain.handle(packet)
            tally.packets += 1
            tally.answers += len(answers)
            tally.violations += check_answers(packet, answers, ids)
            if isinstance(packet, Packet):
                tally.bytes += len(packet.params) + 10
                restores = packet.instruction in RESTORING
            else:
                tally.bytes += len(packet.frame)
                restores = False
            for i, device in enumerate(chain.devices):
                memory = bytes(device.registers.memory)
                if memory == before[i]:
                    continue
                found = check_registers(device, before[i], locked[i] and not restores)
                tally.violations += [f"{text} after {packet}" for text in found]
                tally.changes += 1
                before[i] = memory
            if rng.random() < 0.2:
                now += rng.expovariate(20.0)
                pass_time(rng, chain, now)
                before = [bytes(device.registers.memory) for device in chain.devices]
    return tally


def build_chain(rng: random.Random) -> Chain:
    """Build some servos and a board, with quirks of any kind."""
    quirks = Quirks(
        sync_gap=rng.choice(list(ReadGap)),
        fast_gap=rng.choice(list(ReadGap)),
        reboot_time=0.05,
    )
    servos = [
        VirtualServo(i, model, firmware=rng.choice(FIRMWARES), quirks=quirks)
        for i, model in enumerate(MODELS, start=1)
    ]
    return Chain([*servos, VirtualBoard(200, quirks=quirks)], quirks)


def pass_time(rng: random.Random, chain: Chain, now: float) -> None:
    """Let time pass, the horns turn, and now and then something fail."""
    chain.advance(now)
    for device in chain.devices:
        if isinstance(device, VirtualBoard):
            device.sense_imu([rng.randint(-40_000, 40_000)] * 3, [rng.randint(-9, 9)] * 3)
            continue
        assert isinstance(device, VirtualServo)
        chance = rng.random()
        if chance < 0.3:
            measured = Measured(
                ticks=rng.gauss(2048.0, 3000.0),
                velocity=rng.gauss(0.0, 3.0),
                current=rng.gauss(0.0, 1.0),
                pwm_share=rng.uniform(-1.0, 1.0),
                voltage=rng.choice((5.0, 12.0, 12.0, 12.0, 17.0)),
                temperature=rng.gauss(40.0, 15.0),
            )
            device.sense(measured)
        elif chance < 0.31:
            device.trip(rng.choice(list(HardwareError)))
        elif chance < 0.33:
            device.powered = not device.powered
        elif chance < 0.34:
            device.alive = not device.alive
        drive = device.motor_command()
        assert math.isfinite(drive.target_ticks)
        assert 0.0 <= drive.pwm_limit <= 1.0


# Instructions -------------------------------------------------------------------------------


def draw_instruction(rng: random.Random, devices: Sequence[VirtualDevice]) -> Packet | Damaged:
    """Draw an instruction: mostly one with a meaning, else any bytes at all."""
    kind = rng.random()
    if kind < 0.02:
        return Damaged(rng.randrange(256), rng.randrange(256), rng.randbytes(20))
    if kind < 0.15:
        params = rng.randbytes(rng.randrange(40))
        return Packet(rng.randrange(256), rng.choice((rng.randrange(256), *Instruction)), params)
    device = rng.choice(devices)
    target = BROADCAST if rng.random() < 0.05 else device.id
    if kind < 0.55:
        address, data = draw_write(rng, device)
        params = address.to_bytes(2, "little") + data
        return Packet(target, rng.choice(WRITES[:2]), params)
    if kind < 0.65:
        return draw_group_write(rng, devices)
    if kind < 0.75:
        return draw_group_read(rng, devices)
    if kind < 0.85:
        span = rng.randrange(700).to_bytes(2, "little") + rng.randrange(60).to_bytes(2, "little")
        return Packet(target, Instruction.READ, span)
    return Packet(target, *draw_command(rng))


def draw_command(rng: random.Random) -> tuple[Instruction, bytes]:
    """Draw an instruction that names no register."""
    kept = bytes((rng.choice([*Reset, 7]),))
    return rng.choice(
        [
            (Instruction.PING, b""),
            (Instruction.ACTION, b""),
            (Instruction.ACTION, b""),
            (Instruction.CLEAR, b"\x01\x44\x58\x4c\x22"),
            (Instruction.REBOOT, b"") if rng.random() < 0.3 else (Instruction.PING, b""),
            (Instruction.FACTORY_RESET, kept) if rng.random() < 0.3 else (Instruction.PING, b""),
        ]
    )


def draw_write(rng: random.Random, device: VirtualDevice) -> tuple[int, bytes]:
    """Draw an item and a value near the ends of its range, or any bytes anywhere."""
    kind = rng.random()
    if kind < 0.1:
        return rng.randrange(700), rng.randbytes(rng.randrange(30))
    if kind < 0.35 and "goal_position" in device.table:
        names = ("torque_enable", "operating_mode", "goal_position", "min_position_limit")
        item = device.table[rng.choice(names)]
    else:
        item = rng.choice([item for item in device.table if item.writable])
    if item.name in ("id", "baud_rate", "status_return_level") and rng.random() < 0.9:
        item = device.table["led"]  # a chain whose ids have all become one is dull
    data = draw_value(rng, item)
    if rng.random() < 0.1:
        data = data[:-1] if rng.random() < 0.5 else data + rng.randbytes(rng.randrange(8))
    return item.address, data


def draw_value(rng: random.Random, item: Item) -> bytes:
    """Draw bytes for an item: in its range, at its ends, just beyond them, or anything."""
    lower, upper = item.lower or 0, item.upper or 0
    value = rng.choice((lower, upper, lower - 1, upper + 1, rng.randint(lower, upper), None))
    if value is None:
        return rng.randbytes(item.size)
    return (value % (1 << 8 * item.size)).to_bytes(item.size, "little")


def draw_group_write(rng: random.Random, devices: Sequence[VirtualDevice]) -> Packet:
    """Draw a write to several devices, now and then cut short."""
    chosen = rng.sample(devices, rng.randint(1, len(devices)))
    address, data = draw_write(rng, chosen[0])
    if rng.random() < 0.5:
        params = address.to_bytes(2, "little") + len(data).to_bytes(2, "little")
        for device in chosen:
            params += bytes((device.id,)) + data
        instruction = Instruction.SYNC_WRITE
    else:
        params = b""
        for device in chosen:
            address, data = draw_write(rng, device)
            span = address.to_bytes(2, "little") + len(data).to_bytes(2, "little")
            params += bytes((device.id,)) + span + data
        instruction = Instruction.BULK_WRITE
    cut = rng.randrange(len(params)) if rng.random() < 0.1 else len(params)
    return Packet(BROADCAST, instruction, params[:cut])


def draw_group_read(rng: random.Random, devices: Sequence[VirtualDevice]) -> Packet:
    """Draw a read of several devices, now and then of such as are not there."""
    ids = [device.id for device in rng.sample(devices, rng.randint(1, len(devices)))]
    if rng.random() < 0.2:
        ids[rng.randrange(len(ids))] = rng.randrange(256)
    address, length = rng.randrange(700), rng.randrange(40)
    span = address.to_bytes(2, "little") + length.to_bytes(2, "little")
    if rng.random() < 0.5:
        kind = rng.choice((Instruction.SYNC_READ, Instruction.FAST_SYNC_READ))
        return Packet(BROADCAST, kind, span + bytes(ids))
    kind = rng.choice((Instruction.BULK_READ, Instruction.FAST_BULK_READ))
    return Packet(BROADCAST, kind, b"".join(bytes((i,)) + span for i in ids))


# What must hold -----------------------------------------------------------------------------


def check_registers(device: VirtualDevice, before: bytes, was_locked: bool) -> list[str]:
    """Find what no instruction may leave behind in a device's registers."""
    found: list[str] = []
    for item in device.table:
        value = device.peek(item.name)
        is_tripped = item.name == "bus_watchdog" and value == -1
        if item.writable and not item.accepts(value) and not is_tripped:
            found.append(f"{item.name} is {value}, expected {item.lower} to {item.upper}")
    if isinstance(device, VirtualServo):
        found += check_servo(device, before)
        if was_locked and device.peek("torque_enable"):
            keep = device.table["torque_enable"].address
            if bytes(device.registers.memory[:keep]) != before[:keep]:
                found.append("EEPROM changed under torque")
    return [f"{device.table.model} id {device.id}: {text}" for text in found]


def check_servo(servo: VirtualServo, before: bytes) -> list[str]:
    """Find goals beyond the limits, and modes that a model does not have."""
    found: list[str] = []
    mode = servo.peek("operating_mode")
    if mode not in servo.table.modes:
        found.append(f"operating mode {mode}")
    for goal, limit in LIMITED:
        if goal in servo.table and abs(servo.peek(goal)) > servo.peek(limit):
            found.append(f"{goal} {servo.peek(goal)} beyond {limit} {servo.peek(limit)}")
    goal, item = servo.peek("goal_position"), servo.table["goal_position"]
    is_new = goal != item.decode(before[item.address : item.end])
    lower, upper = servo.peek("min_position_limit"), servo.peek("max_position_limit")
    # A goal may lie outside only where the servo itself made its position the goal.
    is_seeded = goal == servo.peek("present_position")
    in_turn = mode == OperatingMode.POSITION
    if is_new and in_turn and not lower <= goal <= upper and not is_seeded:
        found.append(f"goal_position {goal} beyond {lower} to {upper}")
    if servo.torque_on != bool(servo.peek("torque_enable")):
        found.append("torque_enable does not tell whether the torque is on")
    return found


def check_answers(
    packet: Packet | Damaged, answers: Sequence[Reply], ids: Sequence[int]
) -> list[str]:
    """Find answers that are no frames; devices of one id may garble each other's."""
    found = [f"delay {a.delay}" for a in answers if not 0.0 <= a.delay < math.inf]
    if len(set(ids)) < len(ids) or not answers:
        return found
    if isinstance(packet, Packet) and packet.instruction in FAST and packet.id == BROADCAST:
        lengths = fast_lengths(packet)
        frame = b"".join(answer.data for answer in answers)
        if len(answers) == len(lengths) and len(decode_fast_status(frame, lengths)) < len(lengths):
            found.append(f"fast answer {frame.hex()} to {packet}")
        return found
    for answer in answers:
        items = FrameParser().feed(answer.data)
        if len(items) != 1 or not isinstance(items[0], Packet) or items[0].instruction != 0x55:
            found.append(f"answer {answer.data.hex()} to {packet}")
    return found


def fast_lengths(packet: Packet) -> list[int]:
    """Return the data bytes that a fast read asks of each device."""
    params = packet.params
    if packet.instruction == Instruction.FAST_SYNC_READ:
        return [int.from_bytes(params[2:4], "little")] * len(dict.fromkeys(params[4:]))
    rows = {params[i]: params[i + 3 : i + 5] for i in range(0, len(params) - 4, 5)}
    return [int.from_bytes(row, "little") for row in rows.values()]


def is_under_torque(device: VirtualDevice) -> bool:
    """Return whether a device's EEPROM is locked."""
    return isinstance(device, VirtualServo) and device.torque_on
