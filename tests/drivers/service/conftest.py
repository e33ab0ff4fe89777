"""Two servos on a bench, an XL430 with id 1 and an XM430 with id 3."""

import pytest
from desk import opening, serving_desk

from drivers.dynamixel import bus as bus_module


@pytest.fixture(autouse=True)
def _short_slots(monkeypatch):
    """In lock-step answers to a ping of all come at once: there is no need to wait for 253."""
    monkeypatch.setattr(bus_module, "PING_SLOT", 0.001)


@pytest.fixture
def desk():
    with serving_desk() as served:
        yield served


@pytest.fixture
def bus(desk):
    with opening(desk) as opened:
        yield opened
