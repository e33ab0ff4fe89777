"""The vendor's own handlers talk to virtual servos over the pty, and find nothing odd."""

import math

import pytest

dynamixel_sdk = pytest.importorskip("dynamixel_sdk")

from still_physics import StillPhysics  # noqa: E402

from drivers.virtual_bus.devices.chain import Chain  # noqa: E402
from drivers.virtual_bus.devices.sensors import Measured  # noqa: E402
from drivers.virtual_bus.devices.servo import VirtualServo  # noqa: E402
from drivers.virtual_bus.serving.server import TimeMode, VirtualBus  # noqa: E402

IDS = range(1, 21)
BAUD = 1_000_000
VELOCITY_COUNT = 0.229 * 2.0 * math.pi / 60.0  # rad/s (e-manual)
XM430 = 1020  # model number
FIRMWARE = 46
GOAL_POSITION = 116
PRESENT_PWM, PRESENT_CURRENT, PRESENT_POSITION = 124, 126, 132
LED = 65
PATIENCE_MS = 1000  # of the SDK beyond the wire's time; its own 16 are few on a busy machine


@pytest.fixture(autouse=True)
def patience(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("dynamixel_sdk.port_handler.LATENCY_TIMER", PATIENCE_MS)


@pytest.fixture
def chain():
    servos = [VirtualServo(i, firmware=FIRMWARE, baud=BAUD) for i in IDS]
    for servo in servos:
        servo.poke("return_delay_time", 0)
        velocity = -servo.id * VELOCITY_COUNT
        servo.sense(Measured(ticks=1000 + servo.id, velocity=velocity, temperature=30.0))
    return Chain(servos)


@pytest.fixture(params=TimeMode)
def bus(chain: Chain, request: pytest.FixtureRequest):
    with VirtualBus(chain, StillPhysics(chain), time_mode=request.param) as bus:
        yield bus


@pytest.fixture
def port(bus: VirtualBus):
    port = dynamixel_sdk.PortHandler(bus.path)
    assert port.openPort()
    assert port.setBaudRate(BAUD)
    yield port
    port.closePort()


@pytest.fixture
def packets():
    return dynamixel_sdk.PacketHandler(2.0)


def test_broadcast_ping_finds_all(port, packets):
    found, result = packets.broadcastPing(port)
    assert result == dynamixel_sdk.COMM_SUCCESS
    assert found == {i: [XM430, FIRMWARE] for i in IDS}


def test_write_and_read_of_every_size(port, packets):
    assert packets.write1ByteTxRx(port, 3, LED, 1) == (0, 0)
    assert packets.read1ByteTxRx(port, 3, LED) == (1, 0, 0)
    assert packets.write2ByteTxRx(port, 3, 84, 321) == (0, 0)
    assert packets.read2ByteTxRx(port, 3, 84) == (321, 0, 0)
    assert packets.write4ByteTxRx(port, 3, GOAL_POSITION, 2345) == (0, 0)
    assert packets.read4ByteTxRx(port, 3, GOAL_POSITION) == (2345, 0, 0)


def test_sync_write_then_sync_read(port, packets):
    write = dynamixel_sdk.GroupSyncWrite(port, packets, GOAL_POSITION, 4)
    read = dynamixel_sdk.GroupSyncRead(port, packets, GOAL_POSITION, 4)
    for i in IDS:
        assert write.addParam(i, list((2000 + i).to_bytes(4, "little")))
        assert read.addParam(i)
    assert write.txPacket() == 0
    assert read.txRxPacket() == 0
    assert [read.getData(i, GOAL_POSITION, 4) for i in IDS] == [2000 + i for i in IDS]


@pytest.mark.parametrize("how", ["txRxPacket", "fastSyncRead"])
def test_sync_reads(port, packets, how: str):
    read = dynamixel_sdk.GroupSyncRead(port, packets, PRESENT_CURRENT, 10)
    for i in IDS:
        assert read.addParam(i)
    assert getattr(read, how)() == 0
    assert [read.getData(i, PRESENT_POSITION, 4) for i in IDS] == [1000 + i for i in IDS]
    assert [read.getData(i, 128, 4) for i in IDS] == [2**32 - i for i in IDS]


@pytest.mark.parametrize("how", ["txRxPacket", "fastBulkRead"])
def test_bulk_reads(port, packets, how: str):
    read = dynamixel_sdk.GroupBulkRead(port, packets)
    for i in IDS:
        # The SDK looks a fast answer's id up among all bytes of its request, so an address
        # or a length that equals an id misleads it: these are larger than any.
        start, end = (PRESENT_CURRENT, 147) if i % 2 else (PRESENT_PWM, 146)
        assert read.addParam(i, start, end - start)
    assert getattr(read, how)() == 0
    assert [read.getData(i, PRESENT_POSITION, 4) for i in IDS] == [1000 + i for i in IDS]
    assert {read.getData(i, 144, 2) for i in IDS} == {120}  # 12.0 V
    assert [read.isAvailable(i, 146, 1) for i in IDS] == [i % 2 == 1 for i in IDS]
