"""Ages of samples, and the time that they stand for."""

import numpy as np
import pytest

from drivers.imu.fusion import ImuFusion
from drivers.imu.sample import ImuSample
from drivers.orientation_filter import GRAVITY

UP = np.array([0.0, 0.0, GRAVITY])


def sample(number: int, gyro: float = 0.0, **fields) -> ImuSample:
    """Make a sample that turns about z [rad/s]."""
    counts = number.to_bytes(4, "little")
    return ImuSample(gyro=np.array([0, 0, gyro]), accelerometer=UP, counts=counts, **fields)


def test_a_sample_is_as_old_as_its_source_says():
    fusion = ImuFusion(0.008)
    fusion.start(sample(0), 1.0)
    fusion.update(sample(1, age=0.005), 1.008, speed=0.0)
    assert fusion.stamp == pytest.approx(1.003)


def test_a_rate_stands_for_the_time_that_its_source_says():
    """One radian a second for 0.2 s, handed over within 0.01 s."""
    fusion = ImuFusion(0.008)
    fusion.start(sample(0), 1.0)
    fusion.update(sample(1, gyro=1.0, duration=0.2), 1.01, speed=0.0)
    w, _, _, z = fusion.orientation
    assert 2.0 * np.arctan2(z, w) == pytest.approx(0.2, abs=0.01)
