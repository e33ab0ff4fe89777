"""Several devices on one wire: the bytes they answer, in which order, and when."""

import pytest
from nonempty import nonempty
from wire_talk import find_device, read, read_answers, request, sense, talk, write

from drivers.dynamixel import protocol2
from drivers.dynamixel.protocol2 import ErrorNumber, FrameParser, Instruction, Packet, Span, Status
from drivers.virtual_bus.devices.board import VirtualBoard
from drivers.virtual_bus.devices.chain import Chain
from drivers.virtual_bus.devices.device import Quirks, ReadGap
from drivers.virtual_bus.devices.servo import VirtualServo

POSITION = Span(132, 4)


def servos(*ids: int, quirks: Quirks | None = None, **settings: int) -> Chain:
    chain = Chain([VirtualServo(i, quirks=quirks, **settings) for i in ids], quirks)
    for device in chain.devices:
        device.poke("return_delay_time", 0)
    return chain


OK_FROM_1 = "FFFFFD00 01 0400 55 00 A10C"
MEASURED = {  # by id
    1: {"ticks": 166, "voltage": 11.9},
    2: {"ticks": 2079, "temperature": 36.0},
    3: {"ticks": 166},
    4: {"ticks": 1023, "temperature": 31.0},
    7: {"ticks": 2079, "pwm_share": 421 / 885},
}
GOALS = {1: bytes.fromhex("96000000"), 2: bytes.fromhex("AA000000")}
LIMITS = {1: (32, b"\xa0\0"), 2: (31, b"\x50")}
SPANS = {3: POSITION, 7: Span(124, 2), 4: Span(146, 1)}
MANUAL = [  # what is sent, as published; the reply, as published; what registers hold then
    (protocol2.read(1, POSITION).encode(), "FFFFFD00 01 0700 02 84000400 1D15",
     "FFFFFD00 01 0800 55 00 A6000000 8CC0", {}),
    (protocol2.write(1, 116, b"\0\2\0\0").encode(), "FFFFFD00 01 0900 03 7400 00020000 CA89",
     OK_FROM_1, {(1, "goal_position"): 512}),
    (Packet(1, Instruction.REG_WRITE, b"\x68\0\xc8\0\0\0").encode(),
     "FFFFFD00 01 0900 04 6800 C8000000 AE8E", OK_FROM_1, {}),
    (Packet(1, Instruction.ACTION).encode(), "FFFFFD00 01 0300 05 02CE",
     OK_FROM_1, {(1, "goal_velocity"): 200}),
    (Packet(1, Instruction.CLEAR, b"\1DXL\x22").encode(), "FFFFFD00 01 0800 10 01 44584C22 B1DC",
     OK_FROM_1, {}),
    (protocol2.sync_read([1, 2], POSITION).encode(), "FFFFFD00 FE 0900 82 84000400 0102 CEFA",
     "FFFFFD00 01 0800 55 00 A6000000 8CC0 FFFFFD00 02 0800 55 00 1F080000 BABE", {}),
    (protocol2.sync_write(116, GOALS).encode(),
     "FFFFFD00 FE 1100 83 74000400 01 96000000 02 AA000000 8287",
     "", {(1, "goal_position"): 150, (2, "goal_position"): 170}),
    (protocol2.bulk_read({1: Span(144, 2), 2: Span(146, 1)}).encode(),
     "FFFFFD00 FE 0D00 92 0190000200 0292000100 1A05",
     (Status(1, 0, b"\x77\0").encode() + Status(2, 0, b"\x24").encode()).hex(), {}),
    (protocol2.bulk_write(LIMITS).encode(),
     "FFFFFD00 FE 1000 93 0120000200 A000 021F000100 50 B768",
     "", {(1, "max_voltage_limit"): 160, (2, "temperature_limit"): 80}),
    (protocol2.sync_read([3, 7, 4], POSITION, fast=True).encode(),
     "FFFFFD00 FE 0A00 8A 84000400 030704 20F2",
     "FFFFFD00 FE 1900 55 00 03 A6000000 8408 00 07 1F080000 16CA 00 04 FF030000 D19E", {}),
    (protocol2.bulk_read(SPANS, fast=True).encode(),
     "FFFFFD00 FE 1200 9A 0384000400 077C000200 0492000100 DA2D",
     "FFFFFD00 FE 1400 55 00 03 A6000000 67A4 00 07 A501 2474 00 04 1F D9C1", {}),
    (protocol2.write(1, 100, b"\xff\xff\xfd\xff").encode(),
     "FFFFFD00 01 0A00 03 6400 FFFFFD FD FF 2074",
     OK_FROM_1, {(1, "goal_pwm"): -1, (1, "goal_current"): -3}),
]  # fmt: skip


def test_the_manuals_examples_are_sent_and_answered_as_in_the_manual():
    chain = servos(*MEASURED)
    for device_id, measured in MEASURED.items():
        sense(find_device(chain, device_id), **measured)
    for frame, published, reply, registers in nonempty(MANUAL):
        assert frame == bytes.fromhex(published)
        assert talk(chain, frame) == bytes.fromhex(reply), published
        for (device_id, name), value in registers.items():
            assert read(find_device(chain, device_id), name) == value, published
    ends = [
        (protocol2.reboot(1).encode(), "FFFFFD00 01 0300 08 2F4E"),
        (
            protocol2.factory_reset(1, protocol2.Reset.ALL_BUT_ID).encode(),
            "FFFFFD00 01 0400 06 01 A1E6",
        ),
    ]
    for frame, published in ends:
        assert frame == bytes.fromhex(published)
        assert talk(servos(1), frame) == bytes.fromhex(OK_FROM_1)
    chain = servos(1, 2, firmware=38)
    for device in chain.devices:
        device.poke("model_number", 1030)  # the manual's XM430-W210
    one = bytes.fromhex("FFFFFD00 01 0700 55 00 0604 26 655D")
    two = bytes.fromhex("FFFFFD00 02 0700 55 00 0604 26 6F6D")
    assert protocol2.ping(1).encode() == bytes.fromhex("FFFFFD00 01 0300 01 194E")
    assert talk(chain, protocol2.ping(1).encode()) == one
    assert protocol2.ping().encode() == bytes.fromhex("FFFFFD00 FE 0300 01 3142")
    assert talk(chain, protocol2.ping().encode()) == one + two


def test_each_answer_waits_its_own_return_delay_and_that_to_a_broadcast_ping_its_slot():
    chain = servos(1, 2, 3)
    for device, delay in zip(chain.devices, (250, 0, 100), strict=True):
        device.poke("return_delay_time", delay)
    for fast, last in ((False, 200e-6), (True, 0.0)):
        group = request(protocol2.sync_read([1, 2, 3], POSITION, fast=fast).encode())
        assert [a.delay for a in chain.handle(group)] == pytest.approx([500e-6, 0.0, last])
    chain = servos(9, 3, 200, baud=1_000_000)
    answers = chain.handle(request(protocol2.ping().encode()))
    assert [answer.device for answer in answers] == [3, 9, 200]
    begins, now = [], 0.0
    for answer in answers:
        now += answer.delay
        begins.append(now)
        now += len(answer.data) * 10 / 1_000_000
    assert begins == pytest.approx([0.009, 0.027, 0.6])


def test_what_is_broadcast_is_done_by_all_and_answered_by_none():
    def told(frame: bytes) -> Chain:
        chain = servos(1, 2)
        for device in chain.devices:
            device.poke("position_p_gain", 5)
        assert chain.handle(request(frame)) == []
        return chain

    def look(chain: Chain, name: str) -> list[int]:
        return [device.peek(name) for device in chain.devices]

    everyone = protocol2.BROADCAST
    assert look(told(protocol2.write(everyone, 65, b"\1").encode()), "led") == [1, 1]
    chain = told(Packet(everyone, Instruction.REG_WRITE, b"\x41\0\1").encode())
    assert look(chain, "led") == [0, 0]
    assert chain.handle(request(Packet(everyone, Instruction.ACTION).encode())) == []
    assert look(chain, "led") == [1, 1]
    assert look(told(protocol2.reboot(everyone).encode()), "position_p_gain") == [800, 800]
    told(Packet(everyone, Instruction.CLEAR, b"\1DXL\x22").encode())
    reset = protocol2.factory_reset(everyone, protocol2.Reset.ALL_BUT_ID_AND_BAUD).encode()
    assert look(told(reset), "return_delay_time") == [250, 250]


def test_fast_reads_are_never_stuffed_and_stay_whole_where_a_part_fails():
    chain = servos(1)
    sense(find_device(chain, 1), current=-2.69e-3, velocity=-3 * 0.0239808)  # counts -1 and -3
    span = Span(126, 10)
    frame = talk(chain, protocol2.sync_read([1], span, fast=True).encode())
    assert b"\xff\xff\xfd\xff" in frame[8:]
    assert protocol2.decode_fast_status(frame, [10])[0].data[:6] == b"\xff\xff\xfd\xff\xff\xff"
    slow = talk(chain, protocol2.sync_read([1], span).encode())
    assert b"\xff\xff\xfd\xfd" in slow[8:]
    spans = {1: Span(661, 4), 2: POSITION}  # the first is not to be read
    frame = talk(servos(1, 2), protocol2.bulk_read(spans, fast=True).encode())
    one, two = protocol2.decode_fast_status(frame, [4, 4])
    assert (one.number, one.data) == (ErrorNumber.ACCESS, bytes(4))
    assert (two.number, two.data) == (0, b"\0\x08\0\0")
    chain = Chain([VirtualServo(1), VirtualServo(2, "2XC430-W250"), VirtualServo(3, firmware=44)])
    for order in ([1, 2], [1, 3]):  # the second knows no fast read
        for fast, ids in ((True, [1]), (False, order)):
            packet = protocol2.sync_read(order, POSITION, fast=fast)
            assert [answer.device for answer in chain.handle(packet)] == ids


@pytest.mark.parametrize(
    "die",
    [
        lambda chain: setattr(find_device(chain, 2), "alive", False),
        lambda chain: setattr(find_device(chain, 2), "powered", False),
        lambda chain: find_device(chain, 2).reboot(),
        lambda chain: find_device(chain, 2).poke("status_return_level", 0),
        lambda chain: find_device(chain, 2).poke("id", 99),
    ],
    ids=["cable", "power", "reboot", "return level", "id"],
)
def test_a_silent_member_costs_a_read_its_slot_or_all_that_follows(die):
    chain = servos(1, 2, 3, baud=1_000_000)
    fast = protocol2.sync_read([1, 2, 3], POSITION, fast=True).encode()
    whole = talk(chain, fast)
    die(chain)
    for frame in (
        protocol2.sync_read([1, 2, 3], POSITION).encode(),
        protocol2.bulk_read(dict.fromkeys([1, 2, 3], POSITION)).encode(),
    ):
        chain.quirks = Quirks()
        one, three = chain.handle(request(frame))
        assert (one.device, three.device) == (1, 3)
        assert three.delay == pytest.approx(15 * 10e-6)  # the 15 bytes that did not come
        chain.quirks = Quirks(sync_gap=ReadGap.CHAIN_BREAKS)
        assert [answer.device for answer in chain.handle(request(frame))] == [1]
    assert talk(chain, fast) == whole[:16]
    chain.quirks = Quirks(fast_gap=ReadGap.SLOT_STAYS_EMPTY)
    cut = talk(chain, fast)
    assert len(cut) == len(whole) - 8
    # Its length does not hold, but each piece tells whose it is.
    assert [status.id for status in protocol2.decode_fast_status(cut, [4, 4, 4])] == [1, 3]


def test_what_no_device_understands_is_passed_over_in_silence():
    slow, quick = VirtualServo(1, baud=57_600), VirtualServo(2, baud=2_000_000)
    chain = Chain([slow, quick])
    assert chain.handle(request(protocol2.read(protocol2.BROADCAST, POSITION).encode())) == []
    for instruction in (0x00, 0x33, 0xFF, Instruction.STATUS):
        assert chain.handle(Packet(protocol2.BROADCAST, instruction, b"\1\2\3\4\5\6")) == []
    for device in (2, protocol2.BROADCAST):
        assert chain.handle(protocol2.Damaged(device, Instruction.WRITE, b"")) == []
    ping = request(protocol2.ping().encode())
    for rate, ids in ((57_600, [1]), (2_000_000, [2]), (1_000_000, []), (None, [1, 2])):
        assert [a.device for a in chain.handle(ping, baud=rate)] == ids
    chain.handle(request(protocol2.write(1, 8, b"\4").encode()), baud=57_600)
    assert len(chain.handle(ping, baud=2_000_000)) == 2


def test_two_servos_of_one_id_garble_each_other():
    chain = servos(1, 2, 2)
    assert [
        status.id for status in read_answers(chain.handle(request(protocol2.ping(1).encode())))
    ] == [1]
    for frame in (
        protocol2.ping(2).encode(),
        protocol2.read(2, POSITION).encode(),
        protocol2.sync_read([2], POSITION).encode(),
        protocol2.sync_read([2], POSITION, fast=True).encode(),
    ):
        (answer,) = chain.handle(request(frame))
        assert not any(isinstance(item, Packet) for item in FrameParser().feed(answer.data))
    chain.handle(request(protocol2.write(2, 65, b"\1").encode()))
    assert [device.peek("led") for device in chain.devices] == [0, 1, 1]


def test_any_instruction_on_the_bus_feeds_a_watchdog():
    chain = servos(1, 2)
    for device in chain.devices:
        device.poke("torque_enable", 1)
        device.poke("bus_watchdog", 5)
    for i in range(1, 20):
        chain.advance(0.05 * i)
        chain.handle(request(protocol2.sync_read([1], POSITION).encode()))
    assert [device.peek("bus_watchdog") for device in chain.devices] == [5, 5]


# The board: IMU, voltage and the servos' power switch ------------------------------------------


def test_its_switch_powers_the_servos():
    servo = VirtualServo(1, quirks=Quirks(reboot_time=0.1))
    servo.powered = False
    board = VirtualBoard(on_power=lambda on: setattr(servo, "powered", on))
    chain = Chain([servo, board])
    ping = request(protocol2.ping(1).encode())
    assert chain.handle(ping) == []
    assert write(board, "dynamixel_power", 1) == 0
    assert chain.handle(ping) == []  # still starting
    chain.advance(0.2)
    assert len(chain.handle(ping)) == 1
    assert write(board, "dynamixel_power", 2) == ErrorNumber.DATA_RANGE
    assert write(board, "dynamixel_power", 0) == 0
    assert chain.handle(ping) == []


def test_imu_and_voltage_are_read_in_one_go():
    board = VirtualBoard()
    board.sense_imu([1, -2, 3], [-4, 5, 99_999])
    board.sense_voltage(11.84)
    span = board.table.span("present_input_voltage", "acc_z")
    answers = Chain([board]).handle(request(protocol2.read(200, span).encode()))
    (status,) = read_answers(answers)
    assert status.data == bytes((118,)) + b"".join(
        value.to_bytes(2, "little", signed=True) for value in (1, -2, 3, -4, 5, 32767)
    )
    assert write(board, "gyro_x", 0) == ErrorNumber.ACCESS
    for instruction in (Instruction.REBOOT, Instruction.CLEAR, Instruction.BACKUP):
        status = board.handle(instruction)
        assert status is not None and status.number == ErrorNumber.INSTRUCTION


def test_without_power_the_board_is_gone_and_so_is_the_servos_power():
    switched = []
    board = VirtualBoard(on_power=switched.append)
    write(board, "dynamixel_power", 1)
    board.powered = False
    assert not board.listens and switched == [True, False]
    board.powered = True
    board.advance(1.0)
    assert board.listens and read(board, "dynamixel_power") == 0
