"""The maker's own handlers talk to virtual servos over the pty, and find nothing odd."""

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import pytest

dynamixel_sdk = pytest.importorskip("dynamixel_sdk")

from still_physics import StillPhysics  # noqa: E402

from drivers.dynamixel.control_table import table_named  # noqa: E402
from drivers.virtual_bus.devices.chain import Chain  # noqa: E402
from drivers.virtual_bus.devices.plain_servo import PlainServo  # noqa: E402
from drivers.virtual_bus.devices.sensors import Measured  # noqa: E402
from drivers.virtual_bus.devices.servo import VirtualServo  # noqa: E402
from drivers.virtual_bus.serving.server import TimeMode, VirtualBus  # noqa: E402
from robots.description.servo_catalog import servo_models  # noqa: E402

BAUD = 1_000_000
PATIENCE_MS = 1000  # of the SDK beyond the wire's time; its own 16 are few on a busy machine
SILENCE_MS = 50  # where no reply is to come
IDS = range(1, 21)
PLAIN_IDS = (1, 2, 7)
XM430, FIRMWARE = 1020, 46
VELOCITY_COUNT = 0.229 * 2.0 * math.pi / 60.0  # rad/s (e-manual)
LED, P_GAIN, GOAL_POSITION = 65, 84, 116
PRESENT_PWM, PRESENT_CURRENT, PRESENT_POSITION = 124, 126, 132


@pytest.fixture(autouse=True)
def set_patience(monkeypatch: pytest.MonkeyPatch) -> Callable[[int], None]:
    def set_patience(milliseconds: int) -> None:
        monkeypatch.setattr("dynamixel_sdk.port_handler.LATENCY_TIMER", milliseconds)

    set_patience(PATIENCE_MS)
    return set_patience


@contextmanager
def opening(chain: Chain, time_mode: TimeMode = TimeMode.LOCK_STEP) -> Iterator[Any]:
    with VirtualBus(chain, StillPhysics(chain), time_mode=time_mode) as bus:
        port = dynamixel_sdk.PortHandler(bus.path)
        assert port.openPort()
        assert port.setBaudRate(BAUD)
        yield port
        port.closePort()


@pytest.mark.parametrize("time_mode", TimeMode)
def test_twenty_servos_are_found_read_and_written_in_every_way(time_mode: TimeMode):
    servos = [VirtualServo(i, firmware=FIRMWARE, baud=BAUD) for i in IDS]
    for servo in servos:
        servo.poke("return_delay_time", 0)
        velocity = -servo.id * VELOCITY_COUNT
        servo.sense(Measured(ticks=1000 + servo.id, velocity=velocity, temperature=30.0))
    packets = dynamixel_sdk.PacketHandler(2.0)
    with opening(Chain(servos), time_mode) as port:
        found, result = packets.broadcastPing(port)
        assert result == dynamixel_sdk.COMM_SUCCESS
        assert found == {i: [XM430, FIRMWARE] for i in IDS}
        for size, address, value in ((1, LED, 1), (2, P_GAIN, 321), (4, GOAL_POSITION, 2345)):
            assert getattr(packets, f"write{size}ByteTxRx")(port, 3, address, value) == (0, 0)
            assert getattr(packets, f"read{size}ByteTxRx")(port, 3, address) == (value, 0, 0)
        write = dynamixel_sdk.GroupSyncWrite(port, packets, GOAL_POSITION, 4)
        goals = dynamixel_sdk.GroupSyncRead(port, packets, GOAL_POSITION, 4)
        states = dynamixel_sdk.GroupSyncRead(port, packets, PRESENT_CURRENT, 10)
        some = dynamixel_sdk.GroupBulkRead(port, packets)
        for i in IDS:
            assert write.addParam(i, list((2000 + i).to_bytes(4, "little")))
            assert goals.addParam(i) and states.addParam(i)
            # The SDK looks a fast answer's id up among all bytes of its request, so an address
            # or a length that equals an id misleads it: these are larger than any.
            start, end = (PRESENT_CURRENT, 147) if i % 2 else (PRESENT_PWM, 146)
            assert some.addParam(i, start, end - start)
        assert write.txPacket() == goals.txRxPacket() == 0
        assert [goals.getData(i, GOAL_POSITION, 4) for i in IDS] == [2000 + i for i in IDS]
        for read in (states.txRxPacket, states.fastSyncRead):
            assert read() == 0
            positions = [states.getData(i, PRESENT_POSITION, 4) for i in IDS]
            assert positions == [1000 + i for i in IDS]
            assert [states.getData(i, 128, 4) for i in IDS] == [2**32 - i for i in IDS]
        for read in (some.txRxPacket, some.fastBulkRead):
            assert read() == 0
            positions = [some.getData(i, PRESENT_POSITION, 4) for i in IDS]
            assert positions == [1000 + i for i in IDS]
            assert {some.getData(i, 144, 2) for i in IDS} == {120}  # 12.0 V
            assert [some.isAvailable(i, 146, 1) for i in IDS] == [i % 2 == 1 for i in IDS]


def make_plain(model: str) -> Chain:
    servos = [PlainServo(i, model, baud=BAUD) for i in PLAIN_IDS]
    for servo in servos:
        velocity = -5.0 * servo.table["present_velocity"].scale
        voltage, ticks = servo_models()[model].nominal_voltage, 100.0 + servo.id
        servo.sense(Measured(ticks=ticks, velocity=velocity, voltage=voltage, temperature=31.0))
    return Chain(servos)


@pytest.mark.parametrize("model", ["AX-12A", "MX-28(1.0)"])
def test_a_dynamixel_of_protocol_1_is_pinged_read_and_written(model: str, set_patience):
    table, packets = table_named(model), dynamixel_sdk.PacketHandler(1.0)
    names = ("present_position", "present_velocity", "present_temperature", "goal_position", "led")
    position, speed, temperature, goal, led = (table[name].address for name in names)
    with opening(make_plain(model)) as port:
        assert packets.ping(port, 2) == (table.number, 0, 0)
        assert packets.read2ByteTxRx(port, 7, position) == (107, 0, 0)
        assert packets.read2ByteTxRx(port, 7, speed) == (1024 + 5, 0, 0), "bit 10 is clockwise"
        assert packets.read1ByteTxRx(port, 7, temperature) == (31, 0, 0)
        assert packets.write1ByteTxRx(port, 1, led, 1) == (0, 0)
        assert packets.read1ByteTxRx(port, 1, led) == (1, 0, 0)
        assert packets.regWriteTxRx(port, 1, goal, 2, [44, 1]) == (0, 0)
        assert packets.read2ByteTxRx(port, 1, goal)[0] != 300
        set_patience(SILENCE_MS)
        packets.action(port, 1)
        assert packets.ping(port, 3)[1] == dynamixel_sdk.COMM_RX_TIMEOUT
        set_patience(PATIENCE_MS)
        port.is_using = False
        assert packets.read2ByteTxRx(port, 1, goal) == (300, 0, 0)
        writer = dynamixel_sdk.GroupSyncWrite(port, packets, goal, 2)
        for i in PLAIN_IDS:
            writer.addParam(i, [200 + i, 0])
        assert writer.txPacket() == dynamixel_sdk.COMM_SUCCESS
        assert packets.read2ByteTxRx(port, 7, goal) == (207, 0, 0)
        # Its own group reader passes the handler an argument too many.
        rows = [byte for i in PLAIN_IDS for byte in (2, i, goal)]
        is_known = model.startswith("MX")
        set_patience(PATIENCE_MS if is_known else SILENCE_MS)
        assert packets.bulkReadTx(port, rows, len(rows)) == dynamixel_sdk.COMM_SUCCESS
        data, found, _ = packets.readRx(port, PLAIN_IDS[0], 2)
        assert found == (0 if is_known else dynamixel_sdk.COMM_RX_TIMEOUT)
        if is_known:
            assert data[:2] == [201, 0]
            assert [packets.readRx(port, i, 2)[0][0] for i in PLAIN_IDS[1:]] == [202, 207]


def test_an_xl_320_is_read_by_protocol_2_with_its_own_addresses():
    packets, table = dynamixel_sdk.PacketHandler(2.0), table_named("XL-320")
    with opening(make_plain("XL-320")) as port:
        assert packets.ping(port, 7) == (350, 0, 0)
        assert packets.read2ByteTxRx(port, 7, table["present_position"].address) == (107, 0, 0)
        reader = dynamixel_sdk.GroupSyncRead(port, packets, 37, 2)
        for i in PLAIN_IDS:
            reader.addParam(i)
        assert reader.txRxPacket() == dynamixel_sdk.COMM_SUCCESS
        assert [reader.getData(i, 37, 2) for i in PLAIN_IDS] == [101, 102, 107]
