"""Lines of numbers in described formats."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from imu_bench import KINDS, ImuBench

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
        kind="serial_line",
        format="_ ax ay az gx gy gz",
        separator=",",
        gyro_unit="deg/s",
        accelerometer_unit="g",
    )
    sample = LineFormat(settings).parse(b"17, 0, 0, 1, 180, 0, -90\r")
    assert sample is not None
    assert sample.accelerometer == pytest.approx([0.0, 0.0, 9.81])
    assert sample.gyro == pytest.approx([np.pi, 0.0, -np.pi / 2])


@pytest.mark.parametrize(
    "line",
    [
        b"",
        b"0 0 0 0 0",
        b"0 0 0 0 0 9.81 1",
        b"0 0 0 0 0 9,81",
        b"0 0 0 0 0 nan",
        b"0 0 0 0 0 inf",
        b"0 0 0 0 0 1_0",
        b"0 0 0 0 0 981000",
        b"99999 0 0 0 0 9.81",
        b"0 0 0 0 0 9.81\xff",
        "0 0 0 0 0 ٩".encode(),
    ],
)
def test_a_line_that_is_not_exactly_six_plausible_numbers_is_damaged(line: bytes):
    assert LineFormat(PLAIN).parse(line) is None


def test_a_line_without_an_end_is_dropped_up_to_the_next_feed():
    bench = ImuBench(KINDS["serial line"])
    bench.first()
    bench.port.spoil = lambda _: b"1" * 513
    assert bench.cycle() is None and bench.source.damaged == 1
    bench.port.spoil = lambda line: b" 1 2 3\n" + line  # the end of it, then a whole one
    sample = bench.cycle()
    assert sample is not None and sample.accelerometer[2] == pytest.approx(9.81, abs=0.02)
    assert bench.source.damaged == 1
