"""What is read beside positions, a piece in each cycle: the board, supply, torque, errors."""

from collections import Counter
from itertools import pairwise

import pytest
from desk import make_desk
from memory_rig import Rig

from drivers import Command
from drivers.dynamixel.protocol2 import Instruction
from drivers.state import HardwareError
from robots import Robot

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


@pytest.mark.parametrize("model", ["AX-12A", "XL-320", "STS3215-C018"])
def test_an_error_reaches_the_state_whatever_bit_its_servo_shows_it_by(model: str):
    with Rig(make_desk((1, model), (2, model)), without_imu=True) as rig:
        rig.servo("servo_2").trip(HardwareError.OVERLOAD)
        assert rig.turn(Command.limp(2), 4).alert.tolist() == [0, HardwareError.OVERLOAD]
