"""Virtual chips and their drivers do what the data sheets say, byte for byte, each by itself."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.imu.build import build_i2c_source
from drivers.imu.i2c import I2cChip
from drivers.imu.source import ImuSample, ImuSource
from drivers.virtual_bus.imu.bno055 import VirtualBno055
from drivers.virtual_bus.imu.bno08x_i2c import PACKET, VirtualBno08xI2c
from drivers.virtual_bus.imu.virtual_imu import ImuReading, to_counts
from robots import ImuSettings

UPRIGHT = np.array([1.0, 0.0, 0.0, 0.0])
READING = ImuReading(0.0, np.radians([1.0, -2.0, 0.0]), np.array([0.0, 1.0, 9.81]), UPRIGHT)


def test_a_bno055_answers_frames_as_its_data_sheet_shows():
    chip = VirtualBno055()
    assert chip.receive(bytes.fromhex("AA 01 00 01")) == bytes.fromhex("BB 01 A0")
    assert chip.receive(bytes.fromhex("AA 00 3D 01 05")) == bytes.fromhex("EE 01")
    chip.sense(READING)
    # 1 deg/s are 16 counts, 1 m/s² are 100 (data sheet, 3.6.4).
    assert chip.receive(bytes.fromhex("AA 01 14 04")) == bytes.fromhex("BB 04 1000 E0FF")
    assert chip.receive(bytes.fromhex("AA 01 0A 04")) == bytes.fromhex("BB 04 6400 D503")
    assert chip.receive(bytes.fromhex("AA 01 70 20")) == bytes.fromhex("EE 04"), "too far"
    assert chip.receive(b"\x55") == bytes.fromhex("EE 06"), "no start byte"
    counts = np.frombuffer(to_counts(np.array([40_000.0, -40_000.0, 0.6]), 1.0), "<i2")
    assert counts.tolist() == [32767, -32768, 1]


def bno055(*frames: str, reading: ImuReading = READING) -> VirtualBno055:
    chip = VirtualBno055()
    for frame in frames:
        assert chip.receive(bytes.fromhex(frame)) == bytes.fromhex("EE 01")
    chip.sense(reading)
    return chip


def counts_of(chip: VirtualBno055, register: int) -> list[int]:
    return np.frombuffer(chip.transfer(bytes([register]), 6), "<i2").tolist()


def test_a_bno055_measures_what_its_mode_says_as_far_as_its_ranges_reach():
    spinning = replace(READING, gyro=np.radians([3000.0, -3000.0, 100.0]))
    shaken = replace(READING, accelerometer=9.81 * np.array([20.0, -20.0, 1.0]))
    modes = {0: "", 1: "a", 2: "", 3: "g", 4: "a", 5: "ag", 6: "g", 7: "ag", 9: "a", 12: "ag"}
    for mode, measured in modes.items():
        chip = bno055(f"AA 00 3D 01 {mode:02X}")
        found = [any(counts_of(chip, register)) for register in (0x08, 0x14)]
        assert found == ["a" in measured, "g" in measured], mode
    for code, degrees in enumerate((2000, 1000, 500, 250, 125)):
        setting = f"AA 00 0A 01 {0x38 | code:02X}"
        frames = ("AA 00 07 01 01", setting, "AA 00 07 01 00", "AA 00 3D 01 05")
        chip = bno055(*frames, reading=spinning)
        assert counts_of(chip, 0x14) == [16 * degrees, -16 * degrees, 1600]
    for code, g in enumerate((2, 4, 8, 16)):
        setting = f"AA 00 08 01 {0x0C | code:02X}"
        frames = ("AA 00 07 01 01", setting, "AA 00 07 01 00", "AA 00 3B 01 01", "AA 00 3D 01 05")
        chip = bno055(*frames, reading=shaken)
        assert counts_of(chip, 0x08) == [1000 * g, -1000 * g, 1000]


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


def set_feature(chip: VirtualBno08xI2c, sensor: int, interval: int) -> None:
    feature = bytes.fromhex(f"FD {sensor:02X} 00 0000") + interval.to_bytes(4, "little") + bytes(8)
    chip.transfer(bytes([21, 0, 2, 0]) + feature)


@pytest.mark.parametrize("interval", [10_000, 50_000])
def test_a_bno08x_reports_as_often_as_it_is_asked_to(interval: int):
    chip = VirtualBno08xI2c()
    chip.transfer(b"", 5)
    set_feature(chip, 2, interval)
    count = 0
    for k in range(500):  # one second
        chip.sense(replace(READING, time=0.002 * k))
        while (packet := chip.transfer(b"", 40))[0]:
            assert packet[9] == 2
            count += 1
    assert count == 1_000_000 // interval


class MemoryChip(I2cChip):
    path = "memory"

    def __init__(self) -> None:
        self.restart()

    def transfer(self, data: bytes, count: int = 0) -> bytes:
        return self.exchange(data, count)


class Memory055(MemoryChip):
    """Two pages of plain registers."""

    def restart(self) -> None:
        self.pages = [bytearray(128), bytearray(128)]
        self.pages[0][:4] = bytes.fromhex("A0 FB 32 0F")

    def exchange(self, data: bytes, count: int) -> bytes:
        page = self.pages[self.pages[0][7]]
        for place, value in enumerate(data[1:], start=data[0]):
            page[place] = value
            if place == 7:
                self.pages[0][7] = self.pages[1][7] = value
        return bytes(page[data[0] : data[0] + count])


def test_the_driver_of_a_bno055_sets_and_reads_what_its_data_sheet_means():
    chip = Memory055()
    source = build_i2c_source(ImuSettings(kind="bno055", connection="i2c"), chip)
    source.open()
    chip.pages[0][0x08:0x0E] = np.array([0, 100, -981], "<i2").tobytes()
    chip.pages[0][0x14:0x1A] = np.array([16, -1600, 0], "<i2").tobytes()
    sample = source.measure()
    assert chip.pages[1][0x08] == 0b000_100_10, "normal power, 125 Hz, 8 g"
    assert chip.pages[1][0x0A] == 0b00_010_000, "116 Hz, 2000 deg/s"
    assert chip.pages[0][0x3B] & 0b11 == 0, "deg/s and m/s²"
    assert chip.pages[0][0x3D] == 5, "accelerometer and gyro, without fusion"
    assert sample is not None
    assert sample.gyro == pytest.approx(np.radians([1.0, -100.0, 0.0]))
    assert sample.accelerometer == pytest.approx([0.0, 1.0, -9.81])


def cycles(source: ImuSource, count: int) -> list[ImuSample]:
    samples = []
    for k in range(count):
        source.request(0.008 * k)
        samples.append(source.poll())
    return [sample for sample in samples if sample is not None]


def test_the_driver_of_a_bno055_waits_until_a_mode_is_reached(counted_time):
    """19 ms into the configuration, 7 ms out of it (data sheet, 3.3)."""
    heard: list[tuple[float, bytes]] = []

    class Timed(Memory055):
        def exchange(self, data: bytes, count: int) -> bytes:
            heard.append((counted_time.now, data))
            return super().exchange(data, count)

    source = build_i2c_source(ImuSettings(kind="bno055", connection="i2c"), Timed())
    source.open()
    source.measure()
    modes = {data: k for k, (_, data) in enumerate(heard) if data[0] == 0x3D}
    for mode, wait in ((0, 0.019), (5, 0.007)):
        k = modes[bytes([0x3D, mode])]
        assert wait <= heard[k + 1][0] - heard[k][0] < wait + 0.005


def measuring_055() -> tuple[Memory055, ImuSource]:
    chip = Memory055()
    source = build_i2c_source(ImuSettings(kind="bno055", connection="i2c"), chip)
    source.open()
    chip.pages[0][0x08] = 100
    assert source.measure() is not None
    return chip, source


@pytest.mark.usefixtures("counted_time")
def test_zeros_of_a_bno055_count_in_the_mode_that_it_was_set_to():
    """A free fall: all six values are 0, and so is the memory of a chip that has restarted."""
    chip, source = measuring_055()
    chip.pages[0][0x08] = 0
    assert len(cycles(source, 10)) >= 7
    chip.pages[0][0x08] = 1  # it lands, and restarts
    assert cycles(source, 3)
    chip.pages[0][0x08], chip.pages[0][0x3D] = 0, 0
    assert cycles(source, 3) == []
    assert len(cycles(source, 100)) > 20 and chip.pages[0][0x3D] == 5
    for mode in (0x00, 0x01, 0x0C):
        chip, source = measuring_055()
        chip.pages[0][0x08], chip.pages[0][0x3D] = 0, mode
        cycles(source, 100)
        assert chip.pages[0][0x3D] == 5, f"set again from mode {mode}"
    chip.pages[1][:] = chip.pages[0]
    chip.pages[0][7] = chip.pages[1][7] = 1
    assert cycles(source, 5) == [], "registers of the other page are no sample"
    assert source.damaged == 5


class Memory08x(MemoryChip):
    """Answers with one packet after the other, and remembers what is written."""

    def restart(self) -> None:
        self.written: list[bytes] = []
        self.packets: list[bytes] = []

    def exchange(self, data: bytes, count: int) -> bytes:
        if data:
            self.written.append(data)
            return b""
        packet = self.packets[0] if self.packets else b""
        if count > 4:
            self.packets.pop(0)
        return packet[:count].ljust(count, b"\0")


def test_the_driver_of_a_bno08x_asks_for_and_reads_what_its_manual_means():
    chip = Memory08x()
    source = build_i2c_source(ImuSettings(kind="bno08x", connection="i2c"), chip)
    chip.packets.append(bytes.fromhex("1400 02 00 F8") + bytes(15))
    source.open()
    # 5000 µs are 0x1388; no batches, no sensitivity.
    feature = "00 0000 88130000 00000000 00000000"
    assert chip.written == [
        bytes.fromhex("0600 02 00 F9 00"),
        bytes.fromhex(f"1500 02 01 FD 01 {feature}"),
        bytes.fromhex(f"1500 02 02 FD 02 {feature}"),
    ]
    # 1 m/s² are 256 counts, 1 rad/s are 512.
    packet = bytes.fromhex(
        "1D00 03 00 FB 00000000  01 00 03 00 0000 0001 00F7  02 00 03 00 0002 00FE 0000"
    )
    chip.packets.append(packet)
    sample = source.poll()
    assert sample is not None
    assert sample.accelerometer == pytest.approx([0.0, 1.0, -9.0])
    assert sample.gyro == pytest.approx([1.0, -1.0, 0.0])
    assert source.poll() is None, "nothing has come since"

    def exchange(_data: bytes, count: int) -> bytes:
        return packet[:4] if count == 4 else b"\x1c" + packet[1:]

    chip.exchange = exchange  # type: ignore[method-assign]
    assert source.poll() is None, "its length changed while it was read"
    assert source.damaged > 0
