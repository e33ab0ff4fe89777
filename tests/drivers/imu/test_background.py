"""A sensor that is read in a thread, and buses that are not there."""

import numpy as np
import pytest
from waiting import wait_until

from drivers.imu.build import BackgroundImu, build_imu_source
from drivers.imu.source import ImuError, ImuSample
from robots import ImuSettings


class SlowSensor:
    """A source whose only transfer takes half a second of a clock that it advances itself."""

    name, note, damaged = "slow", "", 7

    def __init__(self) -> None:
        self.now = 10.0
        self.requests: list[float] = []

    def monotonic(self) -> float:
        return self.now

    def open(self) -> None: ...

    def close(self) -> None: ...

    def request(self, now: float) -> None:
        self.requests.append(now)

    def poll(self) -> ImuSample | None:
        if len(self.requests) != 1:
            return None
        self.now += 0.5
        return ImuSample(np.zeros(3), np.array([0.0, 0.0, 9.81]), counts=b"", age=0.25)


def test_a_sample_is_as_old_as_its_transfer_and_the_time_since(monkeypatch):
    sensor = SlowSensor()
    monkeypatch.setattr("drivers.imu.build.time", sensor)
    source = BackgroundImu(sensor)
    assert (source.name, source.note, source.damaged) == ("slow", "", 7)
    source.open()
    try:
        wait_until(lambda: len(sensor.requests) > 2)  # the first sample is there
        sensor.now = 12.0
        sample = source.poll()
    finally:
        source.close()
    assert sensor.requests[0] == 10.0
    assert sample is not None and sample.age == 0.25 + 12.0 - 10.0


@pytest.mark.parametrize("kind", ["bno055", "bno08x"])
def test_an_i2c_bus_that_is_not_there_is_named(kind):
    settings = ImuSettings(kind=kind, connection="i2c", i2c_bus=250)
    source = build_imu_source(settings, "", lambda *_: pytest.fail("no serial port is needed"))
    with pytest.raises(ImuError, match=r"on /dev/i2c-250 at 0x..: No such file or directory; chec"):
        source.open()
