"""The maker's own handlers talk to virtual AX, MX(1.0) and XL-320 servos."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import dynamixel_sdk
import pytest
from still_physics import StillPhysics

from drivers.dynamixel.control_table import table_named
from drivers.virtual_bus.devices.chain import Chain
from drivers.virtual_bus.devices.plain_servo import PlainServo
from drivers.virtual_bus.devices.sensors import Measured
from drivers.virtual_bus.serving.server import TimeMode, VirtualBus
from robots.description.servo_catalog import servo_models

BAUD = 1_000_000
IDS = (1, 2, 7)
LONGEST_WAIT_MS = 1000  # of an SDK beyond the wire's time; its own 16 are few on a busy machine


@pytest.fixture(autouse=True)
def _wait_long(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("dynamixel_sdk.port_handler.LATENCY_TIMER", LONGEST_WAIT_MS)


def make_chain(model: str) -> Chain:
    servos = [PlainServo(i, model, baud=BAUD) for i in IDS]
    figures = servo_models()[model]
    for servo in servos:
        servo.sense(
            Measured(
                ticks=100.0 + servo.id,
                velocity=-5.0 * servo.table["present_velocity"].scale,
                voltage=figures.nominal_voltage,
                temperature=31.0,
            )
        )
    return Chain(servos)


@contextmanager
def opening(model: str) -> Iterator[Any]:
    with VirtualBus(
        chain := make_chain(model), StillPhysics(chain), time_mode=TimeMode.LOCK_STEP
    ) as bus:
        port = dynamixel_sdk.PortHandler(bus.path)
        assert port.openPort()
        assert port.setBaudRate(BAUD)
        yield port
        port.closePort()


@pytest.mark.parametrize("model", ["AX-12A", "MX-28(1.0)"])
def test_a_dynamixel_of_protocol_1_is_pinged_read_and_written(model: str):
    table, packets = table_named(model), dynamixel_sdk.PacketHandler(1.0)
    position, goal, led = (table[n].address for n in ("present_position", "goal_position", "led"))
    with opening(model) as port:
        assert packets.ping(port, 2) == (table.number, 0, 0)
        assert packets.ping(port, 3)[1] == dynamixel_sdk.COMM_RX_TIMEOUT
        assert packets.read2ByteTxRx(port, 7, position) == (107, 0, 0)
        speed = table["present_velocity"].address
        assert packets.read2ByteTxRx(port, 7, speed) == (1024 + 5, 0, 0), "bit 10 is clockwise"
        assert packets.read1ByteTxRx(port, 7, table["present_temperature"].address) == (31, 0, 0)
        assert packets.write1ByteTxRx(port, 1, led, 1) == (0, 0)
        assert packets.read1ByteTxRx(port, 1, led) == (1, 0, 0)
        assert packets.regWriteTxRx(port, 1, goal, 2, [44, 1]) == (0, 0)
        assert packets.read2ByteTxRx(port, 1, goal)[0] != 300
        packets.action(port, 1)
        port.is_using = False
        assert packets.read2ByteTxRx(port, 1, goal) == (300, 0, 0)


def test_a_sync_write_reaches_all_and_a_bulk_read_is_known_to_mx_alone():
    packets = dynamixel_sdk.PacketHandler(1.0)
    goal = table_named("AX-12A")["goal_position"].address
    for model, result in (("MX-28(1.0)", 0), ("AX-12A", dynamixel_sdk.COMM_RX_TIMEOUT)):
        with opening(model) as port:
            writer = dynamixel_sdk.GroupSyncWrite(port, packets, goal, 2)
            for i in IDS:
                writer.addParam(i, [200 + i, 0])
            assert writer.txPacket() == dynamixel_sdk.COMM_SUCCESS
            assert packets.read2ByteTxRx(port, 7, goal) == (207, 0, 0)
            # Its own group reader passes the handler an argument too many.
            rows = [byte for i in IDS for byte in (2, i, goal)]
            assert packets.bulkReadTx(port, rows, len(rows)) == dynamixel_sdk.COMM_SUCCESS
            data, found, _ = packets.readRx(port, IDS[0], 2)
            assert found == result
            if not result:
                assert data[:2] == [201, 0]
                assert [packets.readRx(port, i, 2)[0][0] for i in IDS[1:]] == [202, 207]


def test_an_xl_320_is_read_by_protocol_2_with_its_own_addresses():
    packets, table = dynamixel_sdk.PacketHandler(2.0), table_named("XL-320")
    with opening("XL-320") as port:
        assert packets.ping(port, 7) == (350, 0, 0)
        assert packets.read2ByteTxRx(port, 7, table["present_position"].address) == (107, 0, 0)
        reader = dynamixel_sdk.GroupSyncRead(port, packets, 37, 2)
        for i in IDS:
            reader.addParam(i)
        assert reader.txRxPacket() == dynamixel_sdk.COMM_SUCCESS
        assert [reader.getData(i, 37, 2) for i in IDS] == [101, 102, 107]


def test_what_a_feetech_keeps_without_power_is_behind_its_lock():
    servo = PlainServo(1, "STS3215-C018", baud=BAUD)
    item = servo.table["temperature_limit"]
    for locked, kept in ((1, 70), (0, 60)):
        servo.write(servo.table["eeprom_lock"].address, bytes((locked,)))
        servo.write(item.address, bytes((60,)))
        assert servo.peek("temperature_limit") == 60
        servo.powered = False
        servo.powered = True
        assert servo.peek("temperature_limit") == kept
