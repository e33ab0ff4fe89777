"""Faults on demand: each does what its name says, and comes again from its seed."""

import numpy as np
import pytest
import serial
from fake_devices import FakeDevices
from fault_injector import FaultInjector, LineFault, LineFaults
from hypothesis import given
from hypothesis import strategies as st
from still_physics import StillPhysics
from waiting import LONGEST_WAIT

from drivers.dynamixel import protocol2
from drivers.dynamixel.protocol2 import FrameParser, Packet, Status
from drivers.errors import DriverError
from drivers.virtual_bus.devices.chain import Reply
from drivers.virtual_bus.serving.server import TimeMode, VirtualBus

IDS = (1, 2, 3)
PERIOD = 0.008  # s
STATUS = Status(2, 0, bytes(range(10)))
REPLY = Reply(2, 0.0, STATUS.encode())
REQUESTS = (LineFault.LOSE_REQUEST, LineFault.FLIP_REQUEST, LineFault.ECHO)
REPLY_FAULTS = tuple(fault for fault in LineFault if fault not in REQUESTS)


def line_faults(seed: int = 0) -> LineFaults:
    return LineFaults(np.random.default_rng(seed))


def bytes_of(transmissions) -> bytes:
    return b"".join(transmission.data for transmission in transmissions)


class RecordingPhysics(StillPhysics):
    def __init__(self, devices) -> None:
        super().__init__(devices, PERIOD)
        self.done: list[tuple[str, float]] = []

    def heat(self, servo_id: int, temperature: float) -> None:
        if servo_id == 3:
            raise ValueError("3 is not in list")
        self.done.append(("heat", temperature))

    def sag(self, voltage: float) -> None:
        self.done.append(("sag", voltage))


@pytest.fixture
def devices():
    return FakeDevices(IDS)


@pytest.fixture
def bus(devices: FakeDevices):
    with VirtualBus(devices, RecordingPhysics(devices), time_mode=TimeMode.LOCK_STEP) as bus:
        yield bus


@pytest.fixture
def port(bus: VirtualBus):
    with serial.Serial(bus.path, 1_000_000, timeout=LONGEST_WAIT) as port:
        yield port


@pytest.mark.parametrize("fault", REPLY_FAULTS)
def test_an_order_takes_so_many_answers_of_its_device_and_a_rate_its_share(fault: LineFault):
    line, other = line_faults(), Reply(7, 0.0, Status(7).encode())
    line.strike_next(fault, 2, count=3)
    for _ in range(5):
        assert bytes_of(line.disturb_reply(other)) == other.data
    hit = [line.disturb_reply(REPLY) for _ in range(3)]
    plain = line.disturb_reply(REPLY)
    assert bytes_of(plain) == REPLY.data
    assert all(transmissions != plain for transmissions in hit)
    line.set_rate(fault, 0.02 if fault is LineFault.FLIP else 0.3)
    assert 240 < sum(line.disturb_reply(REPLY) != plain for _ in range(1000)) < 400
    # flips: 1 - 0.98**21 = 0.346; else 0.3
    with pytest.raises(ValueError, match=rf"rate of {fault.value} is 1\.5, expected 0 to 1"):
        line.set_rate(fault, 1.5)


def test_each_mishap_is_what_its_name_says():
    def strike(fault: LineFault):
        line = line_faults(1)
        line.strike_next(fault)
        return line.disturb_reply(REPLY)

    data = REPLY.data
    assert strike(LineFault.LOSE) == []
    assert bytes_of(strike(LineFault.DUPLICATE)) == data + data
    assert data.startswith(bytes_of(strike(LineFault.CUT)))
    assert len(bytes_of(strike(LineFault.CUT))) < len(data)
    assert bytes_of(strike(LineFault.NOISE)).endswith(data)
    first, second = strike(LineFault.SPLIT)
    assert first.data + second.data == data
    assert (first.hold, second.hold) == (0.0, LineFaults.split_pause)
    (late,) = strike(LineFault.LATE)
    assert (late.data, late.hold) == (data, LineFaults.late_by)
    (packet,) = FrameParser().feed(bytes_of(strike(LineFault.WRONG_ID)))
    assert isinstance(packet, Packet)
    assert Status.from_packet(packet) == Status(3, 0, STATUS.data)
    flipped = int.from_bytes(bytes_of(strike(LineFault.FLIP)), "big")
    assert (flipped ^ int.from_bytes(data, "big")).bit_count() == 1


@given(device=st.integers(0, 252), data=st.binary(max_size=20))
def test_a_wrong_id_is_never_the_right_one_and_its_crc_fits(device: int, data: bytes):
    line = line_faults()
    line.strike_next(LineFault.WRONG_ID)
    answer = Reply(device, 0.0, Status(device, 0, data).encode())
    (packet,) = FrameParser().feed(bytes_of(line.disturb_reply(answer)))
    assert isinstance(packet, Packet)
    assert packet.id != device
    assert Status.from_packet(packet).data == data


def test_a_fault_that_cannot_happen_says_what_can_and_harms_nothing(bus, port):
    faults = FaultInjector(bus, np.random.default_rng(0))
    with pytest.raises(
        DriverError, match="'kill' of id 9 cannot be injected: expected one of the ids 1, 2, 3"
    ):
        faults.kill(9)
    with pytest.raises(DriverError, match=r"'heat' of id 3 .* expected a servo"):
        faults.heat(3, 80.0)
    with pytest.raises(DriverError, match="expected a bus with an IMU"):
        faults.freeze_imu()
    port.write(protocol2.ping(1).encode())
    assert len(port.read(14)) == 14
