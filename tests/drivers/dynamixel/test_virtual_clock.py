"""A client of a virtual bus says when its clock falls behind, and only then."""

from types import SimpleNamespace

import pytest
from desk import make_desk
from hypothesis import given
from hypothesis import strategies as st

from drivers.dynamixel.clock import LEAST_LAG, VirtualClock
from drivers.dynamixel.control_table import Item
from drivers.serial_port import PortRefusedError


class Bus:
    """A bus whose servo's clock runs at a share of the wall's."""

    def __init__(self, tick: int = 0, rate: float = 1.0, opens: bool = True) -> None:
        self.time, self.tick, self.rate, self.opens = 100.0, tick, rate, opens
        self.port = SimpleNamespace(path="pts", is_open=False, open=self.open, close=lambda: None)

    def open(self) -> None:
        if not self.opens:
            raise PortRefusedError("pts", "does not exist")

    def read_item(self, device: int, item: Item) -> int:
        assert (device, item.name) == (1, "realtime_tick")
        return int(self.tick + 1000.0 * self.rate * (self.time - 100.0)) % 32768

    def lag_after(self, seconds: float, model: str = "XM430-W350", is_virtual: bool = True) -> str:
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr("drivers.dynamixel.clock.time.monotonic", lambda: self.time)
            patch.setattr("drivers.dynamixel.clock.is_pseudo_terminal", lambda _: is_virtual)
            clock = VirtualClock(self, make_desk((1, model)).joints)
            self.time += seconds
            return clock.describe_lag()


@given(tick=st.integers(0, 32767), seconds=st.floats(0.5, 300.0), rate=st.floats(0.95, 1.0))
def test_a_lag_is_measured_whenever_the_servos_clock_begins_again(tick, seconds, rate):
    said, lag = Bus(tick, rate).lag_after(seconds), (1.0 - rate) * seconds
    if lag > LEAST_LAG + 0.002:
        assert f"fell {lag:.1f} s behind" in said or abs(lag * 10 % 1 - 0.5) < 0.02
    elif lag < LEAST_LAG - 0.002:
        assert said == ""


def test_nothing_is_said_of_what_is_not_known():
    assert "fell 1.0 s behind" in Bus(rate=0.5).lag_after(2.0)
    assert Bus(rate=0.0).lag_after(2.0) == "", "in lock-step time waits for the client"
    assert Bus(rate=0.5).lag_after(2.0, is_virtual=False) == ""
    assert Bus(rate=0.5).lag_after(2.0, "AX-12A") == "", "it has no clock"
    assert Bus(rate=0.5, opens=False).lag_after(2.0) == "", "the bus has ended"
