"""The read of every cycle: how it is requested, who is believed, and who is blamed for silence."""

import time
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from memory_port import MemoryPort

from drivers.dynamixel.bus import DynamixelBus
from drivers.dynamixel.control_table import table_named
from drivers.dynamixel.cyclic_read import CyclicRead, GroupKind
from drivers.dynamixel.diagnostics import ServoFacts
from drivers.dynamixel.protocol1 import PROTOCOL_1
from drivers.dynamixel.protocol2 import ALERT, ErrorNumber, Instruction, Status
from drivers.dynamixel.requests import Replies
from drivers.virtual_bus.devices.chain import Chain
from drivers.virtual_bus.devices.device import Quirks, ReadGap
from drivers.virtual_bus.devices.plain_servo import PlainServo
from drivers.virtual_bus.devices.sensors import Measured
from drivers.virtual_bus.devices.servo import VirtualServo
from robots.bench import make_bench_joint
from robots.description.servo_catalog import servo_models

FAST, SYNC, BULK = Instruction.FAST_SYNC_READ, Instruction.SYNC_READ, Instruction.BULK_READ
GROUP_READS = (FAST, SYNC, BULK, Instruction.READ)
BAUD = 1_000_000
IDS = (1, 2, 3, 4, 5)
POSITION = 6  # offset in a group's bytes: current 2, velocity 4, position 4


def list_facts(joint, tables: dict, firmwares: dict | None = None) -> list[ServoFacts]:
    joints = {i: replace(joint, servo=replace(joint.servo, id=i)) for i in tables}
    firmwares = firmwares or dict.fromkeys(tables, 46)
    return [
        ServoFacts(joint=joints[i], table=table, firmware=firmwares[i], registers={})
        for i, table in tables.items()
    ]


class Bench:
    def __init__(self, joint, ids=IDS, firmwares=(46,), gap=ReadGap.CHAIN_BREAKS) -> None:
        quirks = Quirks(sync_gap=gap, fast_gap=gap)
        versions = dict(zip(ids, firmwares * len(ids), strict=False))
        self.servos = {
            i: VirtualServo(i, firmware=version, baud=BAUD, quirks=quirks)
            for i, version in versions.items()
        }
        for i, servo in self.servos.items():
            servo.poke("return_delay_time", 0)
            servo.sense(Measured(ticks=1000.0 + i))
        self.port = MemoryPort(Chain(list(self.servos.values()), quirks), BAUD)
        self.port.open()
        self.bus = DynamixelBus(self.port, sleeps=False, return_delay=0.0)
        tables = {i: table_named("XM430-W350", version) for i, version in versions.items()}
        self.cyclic = CyclicRead(self.bus, list_facts(joint, tables, versions))

    def turn(self, limit: float = np.inf) -> Replies:
        self.port.sent.clear()
        self.cyclic.begin()
        return self.cyclic.collect(limit)

    def turns(self, cycles: int) -> list[set[int]]:
        return [set(self.turn().devices.tolist()) for _ in range(cycles)]

    @property
    def requests(self) -> list[tuple[int, int, list[int]]]:
        reads = [packet for packet in self.port.sent if packet.instruction in GROUP_READS]
        lengths = [packet.params[2] | packet.params[3] << 8 for packet in reads]
        ids = [list(packet.params[4:]) or [packet.id] for packet in reads]
        return list(zip([packet.instruction for packet in reads], lengths, ids, strict=True))

    def silence(self, device: int, *, is_silent: bool = True) -> None:
        self.servos[device].alive = not is_silent

    def mute(self, *instructions: int) -> None:
        self.port.spoil = lambda packet, replies: (
            [] if packet.instruction in instructions else replies
        )


@pytest.fixture
def joint(tiny):
    return tiny.joints[0]


@pytest.fixture
def bench(joint) -> Bench:
    return Bench(joint)


def ticks_of(replies: Replies) -> dict[int, int]:
    ticks = replies.column(POSITION, "<i4").tolist()
    return dict(zip(replies.devices.tolist(), ticks, strict=True))


def test_servos_that_keep_their_values_in_different_places_are_read_in_bulk(bench, joint):
    table = table_named("XM430-W350")
    items = dict(table.items)
    for name in ("present_current", "present_velocity", "present_position"):
        items[name] = replace(items[name], address=items[name].address + 20)
    facts = list_facts(joint, {1: table, 2: replace(table, items=items)})
    cyclic = CyclicRead(bench.bus, facts)
    assert cyclic.kind is GroupKind.BULK
    cyclic.begin()
    (packet,) = bench.port.frames(BULK)
    assert packet.params[:5] == bytes((2, 146, 0, 11, 0)), "in the first cycle one byte more"
    assert packet.params[5:] == bytes((1, 126, 0, 11, 0))


@pytest.mark.parametrize(
    ("ids", "firmwares", "instruction", "lengths"),
    [
        (IDS, (44,), SYNC, [11, 12, 10, 11]),
        (IDS, (46,), FAST, [10, 10, 10, 10]),
        (IDS, (46, 44), SYNC, [11, 12, 10, 11]),
        ((1, 2, 3), (46,), FAST, [10, 10, 10, 10]),
        ((1, 2), (46,), FAST, [12, 13, 11, 12]),
        ((1,), (46,), FAST, [12, 13, 11, 12]),
    ],
)
def test_a_group_is_read_fast_if_all_can_and_each_time_so_that_a_late_reply_is_known(
    joint, ids, firmwares, instruction, lengths
):
    """By the order, which rotates, or where that does not tell by the length, which alternates."""
    bench, found, orders = Bench(joint, ids, firmwares), [], []
    for _ in lengths:
        bench.turn()
        assert [request[0] for request in bench.requests] == [instruction]
        found.append(bench.requests[0][1])
        orders.append(bench.requests[0][2])
    assert found == lengths
    assert orders[0] == [*ids[1:], ids[0]]
    assert all(later == sooner[1:] + sooner[:1] for sooner, later in pairwise(orders))


@pytest.mark.parametrize("firmware", [46, 44])
@pytest.mark.parametrize("ids", [(7,), (7, 9), IDS])
def test_replies_that_come_a_cycle_late_are_never_believed(joint, ids, firmware):
    bench, kept = Bench(joint, ids, (firmware,)), []

    def hold_back(_, replies):
        bench.port.late, kept[:] = list(kept), replies
        return []

    assert ticks_of(bench.turn())
    bench.port.spoil = hold_back
    for cycle in range(20):
        for i, servo in bench.servos.items():
            servo.sense(Measured(ticks=2000.0 + 10 * cycle + i))
        for i, ticks in ticks_of(bench.turn()).items():
            assert ticks == 2000 + 10 * cycle + i


@pytest.mark.parametrize("firmware", [46, 44])
def test_what_is_missing_is_requested_once_more_the_silent_one_last(joint, firmware):
    bench = Bench(joint, firmwares=(firmware,))
    bench.silence(3)
    replies = bench.turn()
    first, second = bench.requests
    assert first[2] == [2, 3, 4, 5, 1]
    assert second[2] == [4, 5, 1, 3], "those behind it did not get their turn"
    assert ticks_of(replies) == {i: 1000 + i for i in (1, 2, 4, 5)}
    assert bench.bus.statistics.retries == 1
    bench.turn()
    assert bench.requests[0][2] == [4, 5, 1, 2, 3], "last from the next cycle on, too"


@pytest.mark.parametrize(("spare", "retries"), [(0.00049, 0), (0.00051, 1)])
def test_there_is_a_retry_only_if_its_replies_can_come_in_time(bench, monkeypatch, spare, retries):
    monkeypatch.setattr("drivers.dynamixel.cyclic_read.time.monotonic", lambda: 1000.0)
    bench.mute(FAST)
    size = 14 + 5  # bytes of a fast sync read of five, and of its replies
    replied = 8 + 5 * (4 + 11)  # one byte more for the alternating length
    # Cycle 1, and a suspect: 10 + 1 + 1 bytes each.
    on_the_wire = (size + replied + 5) * 10 / BAUD
    bench.turn(limit=1000.0 + on_the_wire + spare)
    assert bench.bus.statistics.retries == retries
    assert len(bench.requests) == 1 + retries


@pytest.mark.parametrize("firmware", [46, 44])
@pytest.mark.parametrize("gap", list(ReadGap))
@pytest.mark.parametrize("silent", [1, 3, 5])
def test_a_silent_servo_is_left_out_after_three_misses_and_costs_no_other(
    joint, silent, gap, firmware
):
    bench = Bench(joint, firmwares=(firmware,), gap=gap)
    bench.turns(4)
    bench.silence(silent)
    others = set(IDS) - {silent}
    for left_out in ([], [], [silent]):
        assert bench.turns(1) == [others]
        assert bench.cyclic.left_out == left_out
    for _ in range(8):
        assert bench.turns(1) == [others]
        assert [set(request[2]) for request in bench.requests] == [others], "still asked"


def test_when_all_are_left_out_nothing_is_sent(joint):
    bench = Bench(joint, ids=(1, 2), firmwares=(44,))
    for device in (1, 2):
        bench.silence(device)
    bench.turns(8)
    assert sorted(bench.cyclic.left_out) == [1, 2]
    replies = bench.turn()
    assert bench.port.sent == []
    assert replies.data.shape == (0, 10) and not replies.devices.size


@pytest.mark.parametrize("firmware", [46, 44])
def test_no_servo_is_blamed_for_what_was_damaged_on_the_wire(joint, firmware):
    bench = Bench(joint, firmwares=(firmware,))
    kind = bench.cyclic.kind
    bench.port.spoil = lambda _, replies: [
        reply[:-1] + bytes((reply[-1] ^ 1,))
        for reply in replies  # its CRC
    ]
    bench.turns(20)
    assert bench.cyclic.left_out == []
    assert bench.cyclic.kind is kind
    bench.port.spoil = lambda _, replies: replies
    assert bench.turns(1) == [set(IDS)]
    assert len(bench.requests[0][2]) == 5 and bench.bus.statistics.damaged > 0


def test_a_servo_that_is_left_out_is_polled_every_ten_cycles(bench):
    bench.silence(3)
    bench.turns(3)
    due = []
    for cycle in range(1, 35):
        bench.turn()
        if bench.cyclic.due_poll() is not None:
            due.append(cycle)
        assert bench.cyclic.due_poll() is None, "once a cycle"
    assert due == [10, 20, 30]


def test_a_servo_that_leaves_and_comes_back_three_times_ends_fast_reads(bench):
    for times in (1, 2, 3):
        assert bench.cyclic.kind is GroupKind.FAST
        bench.silence(3)
        bench.turns(3)
        assert bench.cyclic.left_out == [3]
        bench.silence(3, is_silent=False)
        bench.cyclic.restore(3)
        bench.turn()
        assert (bench.cyclic.kind is GroupKind.SYNC) == (times == 3)
    assert bench.requests[0][0] == SYNC


def test_three_fast_reads_without_a_reply_end_them_for_500_cycles(bench):
    bench.mute(FAST)
    assert bench.turns(2) == [set()] * 2
    assert bench.cyclic.kind is GroupKind.FAST
    bench.turn()
    assert bench.cyclic.kind is GroupKind.SYNC
    assert bench.turns(2)[-1] == set(IDS) - set(bench.cyclic.left_out)
    bench.mute()
    bench.turns(497)
    assert bench.cyclic.kind is GroupKind.SYNC
    bench.turn()
    assert bench.cyclic.kind is GroupKind.FAST
    assert bench.requests[0][0] == FAST


@pytest.mark.parametrize(
    ("error", "is_believed"),
    [(ALERT, True), (ErrorNumber.ACCESS, False), (ALERT | ErrorNumber.DATA_RANGE, False)],
)
def test_an_alert_is_passed_on_and_a_refusal_is_no_value(joint, error, is_believed):
    bench = Bench(joint, firmwares=(44,))
    bench.port.spoil = lambda _, replies: [
        Status(4, error, reply[9:-2]).encode() if reply[4] == 4 else reply for reply in replies
    ]
    replies = bench.turn()
    errors = dict(zip(replies.devices.tolist(), replies.errors.tolist(), strict=True))
    expected = dict.fromkeys(IDS, 0) | {4: error}
    if not is_believed:
        del expected[4]
    assert errors == expected
    assert ticks_of(replies) == {i: 1000 + i for i in expected}
    bench.turns(5)
    assert bench.cyclic.left_out == [], "it is not silent"


def test_servos_that_are_read_one_by_one_are_not_left_out_for_want_of_time():
    """In a cycle without time for all, others are read in the next one."""
    model = servo_models()["AX-12A"]
    chain = Chain([PlainServo(i, "AX-12A") for i in IDS])
    port = MemoryPort(chain, 1_000_000)
    port.open()
    bus = DynamixelBus(port, sleeps=False, wire=PROTOCOL_1, return_delay=0.0)
    facts = list_facts(make_bench_joint(model, 1), dict.fromkeys(IDS, table_named("AX-12A")))
    cyclic, seen = CyclicRead(bus, facts), set[int]()
    assert cyclic.kind is GroupKind.SINGLE
    for _ in range(12):
        cyclic.begin()
        seen.update(cyclic.collect(time.monotonic()).devices.tolist())
        assert len(bus.unsent) == len(IDS) - 1
    assert cyclic.left_out == []
    assert seen == set(IDS)
    cyclic.begin()
    assert set(cyclic.collect(np.inf).devices.tolist()) == set(IDS)
    chain.devices[0].alive = False
    for _ in range(3 * len(IDS)):  # a cycle ends before a reply is late: that is not silence
        cyclic.begin()
        cyclic.collect(time.monotonic() + 0.1 * bus.answer_margin)
    assert cyclic.left_out == []
    for _ in range(5):
        cyclic.begin()
        cyclic.collect(np.inf)
    assert cyclic.left_out == [IDS[0]]
