"""The UART-RVC mode, against the example of the data sheet."""

import numpy as np
import pytest
from imu_bench import KINDS, PERIOD, ImuBench
from nonempty import nonempty

from drivers.imu.bno08x_rvc import FRAME_PERIOD, INDICES, decode_frame

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


def test_a_wrong_byte_anywhere_is_noticed():
    for place in nonempty(range(len(EXAMPLE))):
        spoiled = bytearray(EXAMPLE)
        spoiled[place] ^= 0x10
        assert decode_frame(bytes(spoiled)) is None, place


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
