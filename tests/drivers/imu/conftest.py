"""Time for sensors that are polled in a loop."""

from collections.abc import Iterator

import pytest


class CountedTime:
    """A clock that looking at it and sleeping advance: no test waits, however busy the machine."""

    def __init__(self) -> None:
        self.now = 0.0

    def monotonic(self) -> float:
        self.now += 0.0005
        return self.now

    def sleep(self, duration: float) -> None:
        self.now += duration


@pytest.fixture(scope="module")
def counted_time() -> Iterator[CountedTime]:
    clock = CountedTime()
    with pytest.MonkeyPatch.context() as patch:
        for module in ("bno055", "bno08x", "source"):
            patch.setattr(f"drivers.imu.{module}.time", clock)
        yield clock
