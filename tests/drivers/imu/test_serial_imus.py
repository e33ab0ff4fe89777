"""Serial IMUs: lines of numbers, registers of a BNO055 on a UART, frames of a BNO08x."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from imu_bench import KINDS, PERIOD, ImuBench

from drivers.imu.bno055 import REPLY_TIME, UartRegisters
from drivers.imu.bno08x import FRAME_PERIOD, INDICES, decode_frame
from drivers.imu.serial_line import LineFormat
from robots import ImuSettings

PLAIN = ImuSettings(kind="serial_line")
NUMBERS = st.lists(st.floats(-20.0, 20.0), min_size=6, max_size=6)


@given(values=NUMBERS)
def test_what_is_written_in_the_order_of_the_format_is_read(values: list[float]):
    line = " ".join(map(repr, values)).encode()
    sample = LineFormat(PLAIN).parse(line)
    assert sample is not None
    assert [*sample.gyro, *sample.accelerometer] == values


def test_units_skipped_words_and_separators_are_those_of_the_settings():
    settings = ImuSettings(
        kind="serial_line", format="_ ax ay az gx gy gz", separator=",",
        gyro_unit="deg/s", accelerometer_unit="g",
    )  # fmt: skip
    sample = LineFormat(settings).parse(b"17, 0, 0, 1, 180, 0, -90\r")
    assert sample is not None
    assert sample.accelerometer == pytest.approx([0.0, 0.0, 9.81])
    assert sample.gyro == pytest.approx([np.pi, 0.0, -np.pi / 2])


BAD_LINES = (
    b"", b"0 0 0 0 0", b"0 0 0 0 0 9.81 1", b"0 0 0 0 0 9,81", b"0 0 0 0 0 nan", b"0 0 0 0 0 inf",
    b"0 0 0 0 0 1_0", b"0 0 0 0 0 981000", b"99999 0 0 0 0 9.81", b"0 0 0 0 0 9.81\xff",
    "0 0 0 0 0 ٩".encode(),
)  # fmt: skip


def test_a_line_that_is_not_exactly_six_plausible_numbers_is_damaged():
    assert [line for line in BAD_LINES if LineFormat(PLAIN).parse(line) is not None] == []


def test_a_line_without_an_end_is_dropped_up_to_the_next_feed():
    bench = ImuBench(KINDS["serial line"])
    bench.first()
    bench.port.spoil = lambda _: b"1" * 513
    assert bench.cycle() is None and bench.source.damaged == 1
    bench.port.spoil = lambda line: b" 1 2 3\n" + line  # the end of it, then a whole one
    sample = bench.cycle()
    assert sample is not None and sample.accelerometer[2] == pytest.approx(9.81, abs=0.02)
    assert bench.source.damaged == 1


# Registers of a BNO055 on a UART, one request at a time (data sheet, 4.7) ------------------------


class Wire:
    coming = b""

    def open(self) -> None: ...

    def close(self) -> None: ...

    def send(self, data: bytes) -> None: ...

    def receive(self) -> bytes:
        came, self.coming = self.coming, b""
        return came


def test_another_reply_is_dropped_and_the_next_request_starts_afresh():
    wire = Wire()
    link = UartRegisters(wire)  # type: ignore[arg-type]
    # An error, other registers, one with more behind it, noise, and the reply to a write.
    for count, reply in enumerate(("EE 07", "BB 02 11 22", "BB 03 11 22 33 44", "00", "EE 01"), 1):
        link.read(0x08, 3)
        wire.coming = bytes.fromhex(reply)
        assert link.take() is None
        assert not link.is_busy and link.damaged == count
        link.read(0x08, 1)
        wire.coming = bytes.fromhex("BB 01 42")
        assert link.take() == b"\x42"


def test_a_reply_that_does_not_come_is_given_up(counted_time):
    wire = Wire()
    link = UartRegisters(wire)  # type: ignore[arg-type]
    link.read(0x08, 1)
    counted_time.sleep(0.9 * REPLY_TIME)
    assert link.take() is None and link.is_busy
    counted_time.sleep(0.1 * REPLY_TIME)
    assert link.take() is None and not link.is_busy
    wire.coming = bytes.fromhex("BB 01 41")  # late
    link.read(0x08, 1)
    wire.coming = bytes.fromhex("BB 01 42")
    assert link.take() == b"\x42"


# UART-RVC mode, against the example of the data sheet --------------------------------------------

# BNO080 data sheet (1000-3927, October 2017), 1.3.5.2: yaw 0.01, pitch -1.10, roll 20.85 degrees;
# acceleration -371, -20 and 977 mg.
EXAMPLE = bytes.fromhex("AAAA DE 0100 92FF 2508 8DFE ECFF D103 000000 E7")


def test_the_example_of_the_data_sheet_is_read_as_printed_there():
    frame = decode_frame(EXAMPLE)
    assert frame is not None and frame.index == 222
    assert frame.accelerometer / 9.81 == pytest.approx([-0.371, -0.020, 0.977])
    yaw, pitch, roll = np.radians([0.01, -1.10, 20.85])
    # The third row of Rz(yaw) Ry(pitch) Rx(roll): the world's z axis in the sensor.
    up = [-np.sin(pitch), np.cos(pitch) * np.sin(roll), np.cos(pitch) * np.cos(roll)]
    w, x, y, z = frame.orientation
    message = [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]
    assert message == pytest.approx(up)
    # At rest the accelerometer points there, too, within the noise of the example.
    assert frame.accelerometer / np.linalg.norm(frame.accelerometer) == pytest.approx(up, abs=0.4)
    assert 2.0 * np.arctan2(z, w) == pytest.approx(yaw, abs=5e-3)


def test_frames_on_both_sides_of_a_long_silence_make_no_sample():
    """The index has repeated meanwhile: it does not say how long the robot has turned."""
    rate = 0.5  # rad/s
    bench = ImuBench(KINDS["BNO08x UART-RVC"])
    bench.first()
    bench.sensor.alive = False
    silence = 1.02 * INDICES * FRAME_PERIOD
    assert [bench.cycle(0.0, 0.0, rate) for _ in range(round(silence / PERIOD))].count(None) > 300
    bench.sensor.alive = True
    samples = [s for _ in range(10) if (s := bench.cycle(0.0, 0.0, rate)) is not None]
    assert len(samples) > 3
    for sample in samples:
        assert sample.gyro == pytest.approx([0.0, 0.0, rate], abs=0.02)
