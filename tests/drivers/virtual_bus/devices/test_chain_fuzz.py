"""Whatever comes over the wire: nothing is raised, and no register leaves its range."""

from hypothesis import example, given, settings
from hypothesis import strategies as st

from drivers.dynamixel.protocol2 import BROADCAST, Damaged, Instruction, Packet
from drivers.state import HardwareError
from drivers.virtual_bus.devices.board import VirtualBoard
from drivers.virtual_bus.devices.chain import Chain
from drivers.virtual_bus.devices.device import Quirks, ReadGap, VirtualDevice
from drivers.virtual_bus.devices.sensors import Measured
from drivers.virtual_bus.devices.servo import VirtualServo

IDS = (1, 2, 3, 3, 200)
TRIPPED = -1

gaps = st.sampled_from(ReadGap)
quirks = st.builds(Quirks, sync_gap=gaps, fast_gap=gaps, reboot_time=st.just(0.02))
ids = st.sampled_from([*IDS, 9, 252, 253, BROADCAST, BROADCAST, 255])
codes = st.one_of(st.sampled_from(Instruction), st.integers(0, 255))
raw = st.builds(Packet, ids, codes, st.binary(max_size=40))
starts = st.sampled_from([6, 7, 10, 11, 20, 36, 48, 63, 64, 68, 98, 100, 112, 116, 168, 224])


@st.composite
def spans(draw: st.DrawFn) -> bytes:
    address = draw(st.one_of(starts, st.integers(0, 700)))
    length = draw(st.one_of(st.sampled_from([1, 2, 4, 10]), st.integers(0, 0xFFFF)))
    return address.to_bytes(2, "little") + length.to_bytes(2, "little")


@st.composite
def apt(draw: st.DrawFn) -> Packet:
    """A packet that is nearly right, so that it gets past the first checks."""
    instruction = draw(st.sampled_from(list(Instruction)))
    span, device = draw(spans()), draw(ids)
    some = bytes(draw(st.lists(ids, max_size=6)))
    size = min(int.from_bytes(span[2:], "little"), 300)
    filler = draw(st.sampled_from([b"\x00", b"\x01", b"\x04", b"\x7f", b"\xff"]))
    heads, values = [bytes((i,)) for i in some], filler * size
    groups = {
        Instruction.SYNC_READ: span + some,
        Instruction.FAST_SYNC_READ: span + some,
        Instruction.BULK_READ: b"".join(head + span for head in heads),
        Instruction.FAST_BULK_READ: b"".join(head + span for head in heads),
        Instruction.SYNC_WRITE: span + b"".join(head + values for head in heads),
        Instruction.BULK_WRITE: b"".join(head + span + values for head in heads),
    }
    if instruction in groups:
        return Packet(BROADCAST, instruction, groups[instruction])
    if instruction in (Instruction.WRITE, Instruction.REG_WRITE):
        return Packet(device, instruction, span[:2] + filler * size)
    if instruction is Instruction.READ:
        return Packet(device, instruction, span)
    known = [b"", b"\x01", b"\x02", b"\xff", b"\x01DXL\x22", b"\x01CTRL", b"\x02CTRL"]
    return Packet(device, instruction, draw(st.sampled_from(known)))


damaged = st.builds(Damaged, ids, st.integers(0, 255), st.binary(max_size=20))
events = st.lists(st.one_of(raw, apt(), apt(), damaged, st.floats(0.0, 2.0)), max_size=25)


def build(choice: Quirks) -> Chain:
    models = ("XM430-W350", "XL430-W250", "XC330-T288", "XM540-W270")
    devices: list[VirtualDevice] = [
        VirtualServo(i, model, quirks=choice) for i, model in zip(IDS, models, strict=False)
    ]
    return Chain([*devices, VirtualBoard(quirks=choice)], choice)


def check_registers(chain: Chain) -> None:
    for device in chain.devices:
        for item in device.table:
            value = device.peek(item.name)
            if item.lower is None or item.upper is None:
                continue
            tripped = item.name == "bus_watchdog" and value == TRIPPED
            assert tripped or item.lower <= value <= item.upper, (item.name, value)
        if isinstance(device, VirtualServo):
            check_servo(device)


def check_servo(servo: VirtualServo) -> None:
    assert servo.peek("operating_mode") in servo.table.modes
    for quantity in ("pwm", "current", "velocity"):
        if f"goal_{quantity}" in servo.table:
            assert abs(servo.peek(f"goal_{quantity}")) <= servo.peek(f"{quantity}_limit")
    drive = servo.motor_command()
    assert drive.torque_on == bool(servo.peek("torque_enable"))
    assert 0.0 <= drive.pwm_limit <= 1.0


@settings(max_examples=120, deadline=None)
@given(
    choice=quirks,
    happenings=events,
    physics=st.lists(
        st.tuples(st.floats(-1e6, 1e6), st.floats(-50, 50), st.floats(0, 20), st.floats(-40, 300)),
        max_size=5,
    ),
    error=st.sampled_from(HardwareError),
)
@example(Quirks(), [Packet(BROADCAST, Instruction.FAST_SYNC_READ, b"\0\0\xff\xff\1\2\3")], [], 1)
@example(Quirks(), [Packet(1, Instruction.READ, b"\xff\xff\xff\xff")], [], 1)
@example(Quirks(), [Packet(BROADCAST, Instruction.SYNC_WRITE, b"\0\0\0\0\1\2\3")], [], 1)
def test_no_packet_breaks_the_bus_whatever_physics_or_fault_is_behind_it(
    choice, happenings, physics, error
):
    chain, now, wrong = build(choice), 0.0, []
    servos = [device for device in chain.devices if isinstance(device, VirtualServo)]
    for i, happening in enumerate(happenings):
        if physics:
            ticks, speed, voltage, heat = physics[i % len(physics)]
            measured = Measured(ticks, speed, speed, speed, voltage, heat)
            for servo in servos:
                servo.sense(measured)
                if i == 3:
                    servo.trip(error)
        now += happening if isinstance(happening, float) else 0.01
        chain.advance(now)
        if not isinstance(happening, float):
            wrong += [a for a in chain.handle(happening) if not a.data or a.delay < 0.0]
    assert wrong == []
    check_registers(chain)
