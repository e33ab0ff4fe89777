"""A sensor that is read in a thread, and buses that are not there."""

import numpy as np
import pytest

from drivers.imu.background import BackgroundImu
from drivers.imu.build import build_i2c_source, build_imu_source
from drivers.imu.source import ImuError
from drivers.virtual_bus.imu.bno08x_i2c import VirtualBno08xI2c
from drivers.virtual_bus.imu.reading import ImuReading
from robots import ImuSettings

SETTINGS = ImuSettings(kind="bno08x", connection="i2c", i2c_bus=250)


def test_the_thread_hands_over_what_it_has_read_with_its_age():
    chip = VirtualBno08xI2c()
    up = np.array([0.0, 0.0, 9.81])
    chip.sense(ImuReading(0.0, np.zeros(3), up, np.array([1.0, 0.0, 0.0, 0.0])))
    source = BackgroundImu(build_i2c_source(SETTINGS, chip))
    source.open()
    try:
        sample = source.measure()
        assert sample is not None and 0.0 <= sample.age < 1.0
        assert sample.accelerometer == pytest.approx(up, abs=0.01)
        assert source.poll() is None, "each sample is handed over once"
    finally:
        source.close()
        source.close()


@pytest.mark.parametrize("kind", ["bno055", "bno08x"])
def test_an_i2c_bus_that_is_not_there_is_named(kind):
    settings = ImuSettings(kind=kind, connection="i2c", i2c_bus=250)
    source = build_imu_source(settings, "", lambda *_: pytest.fail("no serial port is needed"))
    with pytest.raises(ImuError, match=r"on /dev/i2c-250 at 0x..: No such file or directory; chec"):
        source.open()
