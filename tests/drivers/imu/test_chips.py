"""Virtual chips and their drivers do what the data sheets say, byte for byte, each by itself."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.imu.build import build_i2c_source
from drivers.imu.i2c import I2cChip
from drivers.imu.sample import ImuSample
from drivers.imu.source import ImuSource
from drivers.virtual_bus.imu.bno055 import VirtualBno055
from drivers.virtual_bus.imu.bno08x_i2c import PACKET, VirtualBno08xI2c
from drivers.virtual_bus.imu.bno08x_rvc import VirtualBno08xRvc
from drivers.virtual_bus.imu.reading import ImuReading
from drivers.virtual_bus.imu.serial_line import VirtualSerialLine
from robots import ImuSettings, quaternion

READING = ImuReading(
    time=0.0,
    gyro=np.radians([1.0, -2.0, 0.0]),
    accelerometer=np.array([0.0, 1.0, 9.81]),
    orientation=np.array([1.0, 0.0, 0.0, 0.0]),
)


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


def bno055(*frames: str, reading: ImuReading = READING) -> VirtualBno055:
    """Make a chip that has heard some frames, then measured."""
    chip = VirtualBno055()
    for frame in frames:
        assert chip.receive(bytes.fromhex(frame)) == bytes.fromhex("EE 01")
    chip.sense(reading)
    return chip


def counts_of(chip: VirtualBno055, register: int) -> list[int]:
    """Read three counts from a register on."""
    return np.frombuffer(chip.transfer(bytes([register]), 6), "<i2").tolist()


def test_a_bno055_has_the_registers_of_its_data_sheet_after_power_up():
    chip = VirtualBno055()
    chip.transfer(bytes.fromhex("3D 05"))
    chip.restart()
    assert chip.transfer(b"\x00", 4) == bytes.fromhex("A0 FB 32 0F")
    assert chip.transfer(b"\x3b", 3) == bytes.fromhex("80 00 00"), "units, _, mode"
    chip.transfer(bytes.fromhex("07 01"))
    assert chip.transfer(b"\x08", 3) == bytes.fromhex("0D 00 38"), "4 g, 62.5 Hz; 2000 deg/s, 32 Hz"


def test_a_bno055_gives_the_unit_that_is_selected():
    # 1 rad/s are 900 counts, 1 mg is 1 count (data sheet, 3.6.4).
    chip = bno055("AA 00 3B 01 03", "AA 00 3D 01 05")
    assert counts_of(chip, 0x14) == [16, -31, 0]  # 1 and -2 deg/s
    assert counts_of(chip, 0x08) == [0, 102, 1000]
    chip = bno055("AA 00 3B 01 00", "AA 00 3D 01 05")
    assert counts_of(chip, 0x14) == [16, -32, 0]
    assert counts_of(chip, 0x08) == [0, 100, 981]


@pytest.mark.parametrize(("code", "degrees"), [(0, 2000), (1, 1000), (2, 500), (3, 250), (4, 125)])
def test_the_gyro_of_a_bno055_reaches_as_far_as_its_range(code: int, degrees: int):
    spinning = replace(READING, gyro=np.radians([3000.0, -3000.0, 100.0]))
    setting = f"AA 00 0A 01 {0x38 | code:02X}"
    frames = ("AA 00 07 01 01", setting, "AA 00 07 01 00", "AA 00 3D 01 05")
    chip = bno055(*frames, reading=spinning)
    assert counts_of(chip, 0x14) == [16 * degrees, -16 * degrees, 1600]


@pytest.mark.parametrize(("code", "g"), [(0, 2), (1, 4), (2, 8), (3, 16)])
def test_the_accelerometer_of_a_bno055_reaches_as_far_as_its_range(code: int, g: int):
    shaken = replace(READING, accelerometer=9.81 * np.array([20.0, -20.0, 1.0]))
    setting = f"AA 00 08 01 {0x0C | code:02X}"
    frames = ("AA 00 07 01 01", setting, "AA 00 07 01 00", "AA 00 3B 01 01", "AA 00 3D 01 05")
    chip = bno055(*frames, reading=shaken)
    assert counts_of(chip, 0x08) == [1000 * g, -1000 * g, 1000]


MODES = {0: "", 1: "a", 2: "", 3: "g", 4: "a", 5: "ag", 6: "g", 7: "ag", 9: "a", 12: "ag"}


@pytest.mark.parametrize("mode", MODES)
def test_a_bno055_measures_what_its_mode_says(mode: int):
    chip = bno055(f"AA 00 3D 01 {mode:02X}")
    assert any(counts_of(chip, 0x08)) == ("a" in MODES[mode])
    assert any(counts_of(chip, 0x14)) == ("g" in MODES[mode])


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


def set_feature(chip: VirtualBno08xI2c, sensor: int, interval: int) -> None:
    """Ask for the reports of a sensor, an interval [µs] apart."""
    feature = bytes.fromhex(f"FD {sensor:02X} 00 0000") + interval.to_bytes(4, "little") + bytes(8)
    chip.transfer(bytes([21, 0, 2, 0]) + feature)


@pytest.mark.parametrize("interval", [10_000, 20_000, 50_000, 100_000])
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


# The drivers, against chips that only remember what is written to them ------------------------


class MemoryChip(I2cChip):
    """A chip that only remembers."""

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
    """Poll a source once a period; return the samples."""
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


@pytest.mark.usefixtures("counted_time")
@pytest.mark.parametrize("mode", [0x00, 0x01, 0x0C])
def test_zeros_of_a_bno055_in_another_mode_mean_that_it_must_be_set_again(mode: int):
    chip, source = measuring_055()
    chip.pages[0][0x08], chip.pages[0][0x3D] = 0, mode
    cycles(source, 100)
    assert chip.pages[0][0x3D] == 5


@pytest.mark.usefixtures("counted_time")
def test_registers_of_the_other_page_are_no_sample():
    chip, source = measuring_055()
    chip.pages[1][:] = chip.pages[0]
    chip.pages[0][7] = chip.pages[1][7] = 1
    assert cycles(source, 5) == []
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
    chip.packets.append(packet_of("0000 0001 00F7", "0002 00FE 0000"))
    sample = source.poll()
    assert sample is not None
    assert sample.accelerometer == pytest.approx([0.0, 1.0, -9.0])
    assert sample.gyro == pytest.approx([1.0, -1.0, 0.0])
    assert source.poll() is None, "nothing has come since"


def packet_of(accelerometer: str, gyro: str) -> bytes:
    """Make a packet of two reports, of three counts each."""
    reports = f"FB 00000000  01 00 03 00 {accelerometer}  02 00 03 00 {gyro}"
    return bytes.fromhex("1D00 03 00" + reports)


def measuring_08x() -> tuple[Memory08x, ImuSource]:
    chip = Memory08x()
    source = build_i2c_source(ImuSettings(kind="bno08x", connection="i2c"), chip)
    chip.packets.append(bytes.fromhex("1400 02 00 F8") + bytes(15))
    source.open()
    return chip, source


def test_of_all_packets_that_wait_the_newest_counts():
    chip, source = measuring_08x()
    chip.packets += [packet_of("0000 0000 0001", f"00{k:02X} 0000 0000") for k in range(9)]
    sample = source.poll()
    assert sample is not None and sample.gyro[0] == 8 * 256 / 512
    assert chip.packets == []


def test_a_packet_whose_length_changes_while_it_is_read_is_damaged():
    chip, source = measuring_08x()
    packet = packet_of("0000 0000 0001", "0001 0000 0000")

    def exchange(_data: bytes, count: int) -> bytes:
        return packet[:4] if count == 4 else b"\x1c" + packet[1:]

    chip.exchange = exchange  # type: ignore[method-assign]
    assert source.poll() is None
    assert source.damaged > 0


def test_a_bno08x_on_a_uart_sends_the_frame_of_its_data_sheet():
    """Yaw 0.01, pitch -1.10, roll 20.85 degrees; -371, -20 and 977 mg (BNO080, 1.3.5.2)."""
    yaw, pitch, roll = 0.5 * np.radians([0.01, -1.10, 20.85])
    turns = [[np.cos(yaw), 0, 0, np.sin(yaw)], [np.cos(pitch), 0, np.sin(pitch), 0]]
    orientation = quaternion.multiply(*map(np.array, turns))
    orientation = quaternion.multiply(orientation, np.array([np.cos(roll), np.sin(roll), 0, 0]))
    force = 9.81e-3 * np.array([-371.0, -20.0, 977.0])
    chip = VirtualBno08xRvc()
    chip.sense(ImuReading(2.22, np.zeros(3), force, orientation))
    frames = chip.take()
    assert len(frames) == 223 * 19, "one every 10 ms"
    assert frames[-19:] == bytes.fromhex("AAAA DE 0100 92FF 2508 8DFE ECFF D103 000000 E7")
    chip.sense(ImuReading(2.56, np.zeros(3), force, orientation))
    assert chip.take()[-17] == 0, "the index is one byte"


def test_a_virtual_line_is_written_in_the_format_of_its_settings():
    settings = ImuSettings(
        kind="serial_line",
        format="ax ay az _ gx gy gz",
        separator=",",
        gyro_unit="deg/s",
        accelerometer_unit="g",
        checksum="nmea",
    )
    chip = VirtualSerialLine(settings)
    chip.sense(READING)
    text = "0.000000,0.101937,1.000000,0.000000,1.000000,-2.000000,0.000000"
    checksum = 0
    for byte in text.encode():
        checksum ^= byte
    assert chip.take() == f"${text}*{checksum:02X}\r\n".encode()
