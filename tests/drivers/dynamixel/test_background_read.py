"""What is read beside positions, a piece in each cycle, and the board on the servo bus."""

from collections import Counter
from itertools import pairwise

import numpy as np
import pytest
from desk import make_desk
from memory_port import MemoryPort
from memory_rig import Rig

from drivers import Command
from drivers.dynamixel.board import Board, check_board
from drivers.dynamixel.bus import DynamixelBus
from drivers.dynamixel.protocol2 import Instruction
from drivers.imu.source import ImuError
from drivers.state import HardwareError
from drivers.virtual_bus.devices.board import VirtualBoard
from drivers.virtual_bus.devices.chain import Chain
from robots import BoardSettings, Robot

BOARD = 200


def background(rig: Rig, cycles: int) -> list[list[tuple[int, int]]]:
    """Run cycles without torque; return the ids and addresses of each one's background read."""
    limp, reads = Command.limp(rig.robot.n), []
    for _ in range(cycles):
        rig.port.sent.clear()
        rig.turn(limp)
        reads.append([])
        for packet in rig.port.frames(Instruction.BULK_READ):
            rows = [packet.params[at : at + 5] for at in range(0, len(packet.params), 5)]
            reads[-1] += [(row[0], row[1] | row[2] << 8) for row in rows]
        for packet in rig.port.frames(Instruction.READ):
            reads[-1].append((packet.id, packet.params[0] | packet.params[1] << 8))
    return reads


@pytest.fixture
def rig(tiny: Robot):
    with Rig(tiny) as rig:
        yield rig


def test_each_cycle_reads_the_board_and_one_item_of_one_servo_in_turns(rig: Rig):
    reads = background(rig, 12)
    assert all(len(read) == 2 and read[0][0] == BOARD for read in reads)
    items = Counter(read[1] for read in reads)
    # Torque enable, bus watchdog, and supply with temperature of both servos, each twice.
    assert items == {(servo, item): 2 for servo in (1, 2) for item in (64, 98, 144)}


def test_a_silent_board_is_read_last_and_in_every_fifth_cycle(rig: Rig):
    rig.virtual.board.alive = False
    reads = background(rig, 43)
    cycles = [k for k, read in enumerate(reads) if BOARD in [device for device, _ in read]]
    assert cycles[:3] == [0, 1, 2], "three misses"
    assert len(cycles[3:]) == 8 and {b - a for a, b in pairwise(cycles[3:])} == {5}
    assert reads[0][0][0] == BOARD
    assert all(reads[k][-1][0] == BOARD for k in cycles[1:])
    rig.virtual.board.alive = True
    background(rig, 5)
    assert all(read[0][0] == BOARD for read in background(rig, 5)[1:])


def test_the_cause_of_an_alert_is_read_at_once_and_further_causes_in_turn(rig: Rig):
    servo = rig.servo("l_hip")
    servo.trip(HardwareError.OVERLOAD)
    state = rig.turn(Command.limp(2), 2)
    assert state.alert.tolist() == [HardwareError.OVERLOAD, 0]
    servo.trip(HardwareError.OVERHEATING)
    state = rig.turn(Command.limp(2), 12)
    assert state.alert.tolist() == [HardwareError.OVERLOAD | HardwareError.OVERHEATING, 0]
    servo.poke("hardware_error_status", 0)
    assert not rig.turn(Command.limp(2), 2).alert.any(), "it is gone"


def test_an_alert_that_passes_before_its_cause_is_read_is_gone_as_well(rig: Rig):
    rig.virtual.physics.sag(9.4)
    assert rig.turn(Command.limp(2)).alert.all()
    rig.virtual.physics.sag(12.0)
    rig.turn(Command.limp(2))
    for _ in range(3):
        assert not rig.turn(Command.limp(2)).alert.any()


@pytest.mark.parametrize("model", ["AX-12A", "XL-320", "STS3215-C018"])
def test_an_error_reaches_the_state_whatever_bit_its_servo_shows_it_by(model: str):
    with Rig(make_desk((1, model), (2, model)), without_imu=True) as rig:
        rig.servo("servo_2").trip(HardwareError.OVERLOAD)
        assert rig.turn(Command.limp(2), 4).alert.tolist() == [0, HardwareError.OVERLOAD]


# The board: its registers, and the checks at the start -------------------------------------------

BAUD = 2_000_000
OPENCR = BoardSettings(model="OpenCR", id=200, imu_axes=("y", "-x", "z"), powers_servos=True)


class Bench:
    def __init__(self) -> None:
        self.powered: list[bool] = []
        self.virtual = VirtualBoard(200, baud=BAUD, on_power=self.powered.append, settings=OPENCR)
        port = MemoryPort(Chain([self.virtual]), BAUD)
        port.open()
        self.board = Board(DynamixelBus(port, sleeps=False), OPENCR)


@pytest.fixture
def bench() -> Bench:
    return Bench()


def test_counts_of_an_opencr_are_those_of_its_sensor(bench: Bench):
    """16.4 counts per deg/s, 16384 counts per g (ROBOTIS-OP3, open_cr_module)."""
    counts = np.array([164, -1640, 0, 0, 16384, -8192], "<i2").tobytes()
    sample = bench.board.decode(counts)
    # The site's axes are y, -x and z of the sensor's.
    assert sample.gyro == pytest.approx(np.radians([-100.0, -10.0, 0.0]))
    assert sample.accelerometer == pytest.approx([9.81, 0.0, -9.81 / 2.0])


def test_the_length_of_its_reply_alternates_and_the_sample_does_not(bench: Bench):
    bench.virtual.sense_imu((1, 2, 3), (4, 5, 6))
    spans = [bench.board.span(cycle) for cycle in range(4)]
    assert spans[0] == spans[2] and spans[1] == spans[3]
    assert spans[0].length != spans[1].length
    data = [bench.virtual.read(span.address, span.length)[1] for span in spans[:2]]
    assert bench.board.decode(data[0]).counts == bench.board.decode(data[1]).counts


def test_the_check_switches_the_servos_on_and_its_delay_off(bench: Bench):
    bench.virtual.poke("return_delay_time", 250)
    assert check_board(bench.board, set_delay=False) == []
    assert bench.virtual.peek("return_delay_time") == 250
    assert bench.powered[-1] is True and bench.board.is_powering()
    assert check_board(bench.board) == []
    assert bench.virtual.peek("return_delay_time") == 0


def test_a_board_that_cannot_be_used_is_refused_and_has_no_sample():
    for item, value, text in (
        ("model_number", 7, "is of model 7, expected"),
        ("baud_rate", 3, "uses 1000000 bit/s, expected 2000000"),
        (None, 0, "silent; check its power, its cable"),
    ):
        bench = Bench()
        if item is None:
            bench.virtual.alive = False
            assert bench.board.measure() is None
        else:
            bench.virtual.poke(item, value)
        with pytest.raises(ImuError, match=f"board 'OpenCR' [(]id 200[)]: {text}"):
            bench.board.open()
