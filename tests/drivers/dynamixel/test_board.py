"""A controller board on the servo bus: its registers, and the checks at the start."""

import numpy as np
import pytest
from memory_port import MemoryPort

from drivers.dynamixel.board import Board, check_board
from drivers.dynamixel.bus import DynamixelBus
from drivers.imu.source import ImuError
from drivers.virtual_bus.devices.board import VirtualBoard
from drivers.virtual_bus.devices.chain import Chain
from robots import BoardSettings

BAUD = 2_000_000
OPENCR = BoardSettings(model="OpenCR", id=200, imu_axes=("y", "-x", "z"), powers_servos=True)


class Bench:
    """The driver's board and the virtual one."""

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
