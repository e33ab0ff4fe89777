"""Devices found on a port, whatever the robot."""

from collections import deque

import pytest
from memory_port import MemoryPort

from drivers.dynamixel.bus import DynamixelBus
from drivers.dynamixel.protocol1 import PROTOCOL_1, ChecksumParser
from drivers.dynamixel.protocol2 import BROADCAST, ErrorNumber, Instruction, Packet, Status
from drivers.serial_port import PortRefusedError
from drivers.service import sweep
from drivers.service.scan import FoundDevice, FoundImu, check_rate, find_imus, scan_port
from drivers.virtual_bus.devices.board import VirtualBoard
from drivers.virtual_bus.devices.chain import Chain
from drivers.virtual_bus.devices.plain_servo import PlainServo
from drivers.virtual_bus.devices.sensors import Measured
from drivers.virtual_bus.devices.servo import VirtualServo
from drivers.virtual_bus.imu.bno055 import VirtualBno055
from drivers.virtual_bus.imu.bno08x_i2c import VirtualBno08xI2c

BAUD = 1_000_000


def servo(number: int, *, baud: int = BAUD, model: str = "XM430-W350") -> VirtualServo:
    one = VirtualServo(number, model, firmware=45, baud=baud)
    one.sense(Measured(ticks=2000.0 + number, voltage=11.9, temperature=31.0 + number))
    return one


def port_of(*devices, baud: int = BAUD) -> MemoryPort:
    port = MemoryPort(Chain(list(devices)), baud)
    port.open()
    return port


def find_devices(port: MemoryPort) -> list[FoundDevice]:
    return list(scan_port(port, (BAUD,)).found)


def test_devices_are_listed_by_id_with_what_they_measure():
    board, stranger = VirtualBoard(baud=BAUD), servo(5)
    board.sense_voltage(12.1)
    stranger.poke("model_number", 12345)
    found = find_devices(port_of(servo(7), board, stranger, servo(3, model="XL430-W250")))
    assert found.pop(1) == FoundDevice(id=5, baud=BAUD, number=12345, firmware=45)
    assert [(d.id, d.number, d.model, d.firmware, d.is_board) for d in found] == [
        (3, 1060, "XL430-W250", 45, False),
        (7, 1020, "XM430-W350", 45, False),
        (200, 0x7400, "OpenCR", 1, True),
    ]
    assert {d.baud for d in found} == {BAUD}
    assert [d.values["present_input_voltage"] for d in found] == [119, 119, 121]
    assert [d.values.get("present_temperature") for d in found] == [34, 38, None]
    assert found[0].values["present_position"] == 2003 and not found[0].values["torque_enable"]
    port = port_of()
    port.spoil = lambda packet, _: [packet.encode()]
    assert find_devices(port) == [], "an echo of the adapter is none"


def test_two_servos_of_one_id_are_one_doubled_device():
    (found,) = find_devices(port_of(servo(4), servo(4, model="XM540-W270")))
    assert (found.id, found.doubled, found.model) == (4, True, None)
    # As shipped, all AX have the id 1.
    pair = [PlainServo(1, model, baud=BAUD) for model in ("AX-12A", "AX-18A")]
    found = find_devices(port_of(*pair, PlainServo(3, "AX-12A", baud=BAUD)))
    assert [(d.id, d.doubled, d.model) for d in found] == [(1, True, None), (3, False, "AX-12A")]
    assert found[0].protocol == "1.0 or feetech"


def refuse(packet: Packet, replies: list[bytes]) -> list[bytes]:
    refusal = Status(4, ErrorNumber.ACCESS).encode()
    return [refusal] if packet.instruction == Instruction.READ else replies


@pytest.mark.parametrize(
    ("spoil", "doubled", "voltage"),
    [
        # Return delays of 0 and 500 µs: the second reply begins after the first has ended.
        (lambda _, replies: replies * 2, True, 119),
        (lambda sent, replies: replies * (1 + (sent.id == BROADCAST)), False, 119),
        (refuse, False, None),
    ],
    ids=["all replies twice", "that to the broadcast ping", "no register is read"],
)
def test_a_servo_is_doubled_where_all_of_its_replies_come_twice(spoil, doubled, voltage):
    port = port_of(servo(4))
    port.spoil = spoil
    (found,) = find_devices(port)
    assert (found.id, found.doubled) == (4, doubled)
    assert found.values.get("present_input_voltage") == voltage


def test_noise_in_one_reply_of_a_suspect_doubles_no_device():
    port = port_of(servo(4))

    def disturb(packet: Packet, replies: list[bytes]) -> list[bytes]:
        if packet.id == BROADCAST:
            return replies * 2  # so that its id is looked at more closely
        is_first = len([sent for sent in port.sent if sent.id == 4]) == 7
        return [replies[0][:-1]] if is_first else replies

    port.spoil = disturb
    (found,) = find_devices(port)
    assert [packet.instruction for packet in port.sent[:8]] == [1, *[2] * 6, 1]
    assert (found.id, found.doubled) == (4, False)


def test_a_late_reply_doubles_no_other_device():
    """The replies to the first reads come three requests late, so in the time of the next id."""
    port, waiting = port_of(servo(3), servo(4)), deque[list[bytes]]()

    def delay(packet: Packet, replies: list[bytes]) -> list[bytes]:
        if packet.instruction != Instruction.READ or len(port.frames(Instruction.READ)) > 6:
            return replies
        waiting.append(replies)
        return waiting.popleft() if len(waiting) > 3 else []

    port.spoil = delay
    found = find_devices(port)
    assert [(device.id, device.doubled) for device in found] == [(3, False), (4, False)]
    assert [device.values["present_temperature"] for device in found] == [34, 35]


def test_every_rate_is_tried_and_the_port_is_closed():
    port = port_of(servo(1), servo(2, baud=57_600))
    scan = scan_port(port, (57_600, BAUD, 2_000_000))
    assert [(device.id, device.baud) for device in scan.found] == [(2, 57_600), (1, BAUD)]
    assert (scan.rates, scan.refused_rates) == ((57_600, BAUD, 2_000_000), ())
    assert not port.is_open


class PickyPort(MemoryPort):
    def open(self) -> None:
        if self.baud != BAUD:
            raise PortRefusedError(self.path, "is refused")
        super().open()

    def set_baud(self, baud: int) -> None:
        self.baud = baud


def test_rates_that_the_adapter_refuses_are_listed():
    scan = scan_port(PickyPort(Chain([servo(1)]), BAUD), (57_600, BAUD))
    assert (scan.rates, scan.refused_rates) == ((BAUD,), (57_600,))
    assert [device.id for device in scan.found] == [1]
    with pytest.raises(PortRefusedError, match="is refused"):
        scan_port(PickyPort(Chain([]), BAUD), (57_600,))
    with pytest.raises(ValueError, match="baud is 1234 bit/s, expected 9600, 57600"):
        check_rate(1234)


# Protocols without a broadcast ping --------------------------------------------------------


@pytest.fixture(autouse=True)
def _few_ids(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sweep, "SWEPT", range(4))


def test_a_servo_that_replies_to_pings_alone_is_found():
    """At Status Return Level 0 an AX answers no read (e-manual)."""
    ax, other = (PlainServo(i, "AX-12A", baud=BAUD) for i in (1, 3))
    ax.poke("status_return_level", 0)
    found = find_devices(port_of(ax, other))
    assert [(d.id, d.model, d.only_pings) for d in found] == [(1, None, True), (3, "AX-12A", False)]
    assert {device.protocol for device in found} == {"1.0"}
    assert not any(device.doubled for device in found)


def test_an_id_whose_reply_comes_late_is_found_in_the_second_round():
    port, waiting = port_of(PlainServo(1, "AX-12A", baud=BAUD)), list[bytes]()

    def delay(packet: Packet, replies: list[bytes]) -> list[bytes]:
        if packet.id == 1 and len([sent for sent in port.sent if sent.id == 1]) == 1:
            waiting.extend(replies)
            return []
        late, waiting[:] = list(waiting), []
        return [*late, *replies]

    port.spoil = delay
    assert [device.id for device in find_devices(port)] == [1]


def test_silent_ids_are_pinged_once_where_nothing_replies():
    port = port_of()
    port.chain.wire, port._parser = PROTOCOL_1, ChecksumParser()
    assert sweep.list_speakers(DynamixelBus(port), sweep.ALIKE) == {}
    assert [packet.id for packet in port.sent] == [0, 1, 2, 3]
    port = port_of(PlainServo(1, "AX-12A", baud=BAUD))
    port.spoil = lambda packet, replies: [PROTOCOL_1.encode(packet), *replies]
    assert list(sweep.list_speakers(DynamixelBus(port), sweep.ALIKE)) == [1], "an echo is none"


# IMUs on I2C buses -------------------------------------------------------------------------------


class OtherChip(VirtualBno055):
    def transfer(self, data: bytes, count: int = 0) -> bytes:
        del data
        return b"\xff" * count


def test_each_imu_is_named_with_its_bus_and_other_chips_are_left_out():
    chips = {(1, 0x29): VirtualBno055(), (3, 0x4A): VirtualBno08xI2c()}
    chips |= {(1, 0x28): OtherChip(), (1, 0x4B): OtherChip()}
    silent = VirtualBno055()
    silent.alive = False
    assert find_imus((1, 2, 3), lambda bus, address: chips.get((bus, address), silent)) == [
        FoundImu(path="virtual I2C", model="BNO055"),
        FoundImu(path="virtual I2C", model="BNO08x"),
    ]
    assert find_imus((250,)) == [], "there is no such bus"
