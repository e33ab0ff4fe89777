"""The virtual chips do what their data sheets say, byte for byte."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.imu.bno08x_i2c import PACKET
from drivers.virtual_bus.imu.bno055 import VirtualBno055
from drivers.virtual_bus.imu.bno08x_i2c import VirtualBno08xI2c
from drivers.virtual_bus.imu.reading import ImuReading

READING = ImuReading(
    time=0.0,
    gyro=np.radians([1.0, -2.0, 0.0]),
    accelerometer=np.array([0.0, 1.0, 9.81]),
    orientation=np.array([1.0, 0.0, 0.0, 0.0]),
)


def test_a_bno055_answers_frames_as_its_data_sheet_shows():
    chip = VirtualBno055()
    assert chip.hear(bytes.fromhex("AA 01 00 01")) == bytes.fromhex("BB 01 A0")
    assert chip.hear(bytes.fromhex("AA 00 3D 01 05")) == bytes.fromhex("EE 01")
    chip.sense(READING)
    # 1 deg/s are 16 counts, 1 m/s² are 100 (data sheet, 3.6.4).
    assert chip.hear(bytes.fromhex("AA 01 14 04")) == bytes.fromhex("BB 04 1000 E0FF")
    assert chip.hear(bytes.fromhex("AA 01 0A 04")) == bytes.fromhex("BB 04 6400 D503")
    assert chip.hear(bytes.fromhex("AA 01 70 20")) == bytes.fromhex("EE 04"), "past the registers"
    assert chip.hear(b"\x55") == bytes.fromhex("EE 06"), "no start byte"


def test_a_bno055_keeps_its_settings_while_it_measures():
    chip = VirtualBno055()
    for frame in ("AA 00 3D 01 05", "AA 00 07 01 01", "AA 00 08 01 12"):
        chip.hear(bytes.fromhex(frame))
    assert chip.hear(bytes.fromhex("AA 01 08 01")) == bytes.fromhex("BB 01 00")


@given(sizes=st.lists(st.integers(4, 40), min_size=1, max_size=60))
def test_a_packet_read_in_parts_is_the_packet_read_at_once(sizes: list[int]):
    """Every part begins with a header; all but the first are marked as continuations."""

    def ready() -> VirtualBno08xI2c:
        chip = VirtualBno08xI2c()
        chip.transfer(b"", 5)  # that the hub has started
        chip.transfer(PACKET.pack(6, 2, 0) + bytes([0xF9, 0]))
        return chip

    whole = ready().transfer(b"", 20)
    chip, cargo = ready(), b""
    for number, size in enumerate(sizes):
        left = 16 - len(cargo)
        part = chip.transfer(b"", size)
        length, channel, sequence = PACKET.unpack(part[:4])
        assert (length & 0x7FFF, channel, sequence) == (4 + left, 2, 0)
        assert bool(length & 0x8000) == (number > 0)
        cargo += part[4 : 4 + left]
        if len(cargo) == 16:
            break
    assert whole[4:].startswith(cargo)


def test_reports_of_a_bno08x_are_in_the_units_of_their_q_points():
    """Q8 for m/s², Q9 for rad/s (SH-2)."""
    chip = VirtualBno08xI2c()
    chip.sense(READING)
    chip.transfer(b"", 5)
    for sensor, scale, expected in ((1, 256.0, READING.accelerometer), (2, 512.0, READING.gyro)):
        for on in (sensor, 3 - sensor):  # this one alone
            interval = "88130000" if on == sensor else "00000000"
            feature = bytes.fromhex(f"FD {on:02X} 00 0000 {interval} 00000000 00000000")
            chip.transfer(PACKET.pack(4 + len(feature), 2, 0) + feature)
        packet = b""
        while (more := chip.transfer(b"", 40))[0]:
            packet = more
        assert packet[0] == 19 and packet[2] == 3 and packet[4] == 0xFB and packet[9] == sensor
        values = np.frombuffer(packet[13:19], "<i2")
        assert values / scale == pytest.approx(expected, abs=0.002)
