"""In real time every byte takes its time on the wire; the clock here is a number."""

import pytest
from fake_devices import FakeDevices
from fake_wire import FakeWire, exchange_with
from fault_injector import LineFault

from drivers.dynamixel import protocol2
from drivers.dynamixel.protocol2 import Span
from drivers.virtual_bus.serving import real_time
from drivers.virtual_bus.serving.lock_step import IDLE
from drivers.virtual_bus.serving.real_time import MICROFRAME, RealTime

IDS = (1, 2, 3)
BYTE = 1e-5  # s at 1 Mbit/s
READ = protocol2.read(2, Span(132, 4)).encode()  # 14 bytes; its reply has 15
GROUP = protocol2.sync_read(IDS, Span(132, 4)).encode()  # 17 bytes; three replies of 15
STEP = 2e-6  # s that a poll of the clock may take


class Served:
    def __init__(self, monkeypatch, devices: FakeDevices, latency: float = 0.0, **wire) -> None:
        self.wire, self.devices = FakeWire(**wire), devices
        monkeypatch.setattr(real_time, "monotonic", self.wire.monotonic)
        monkeypatch.setattr(real_time, "sleep", self.wire.sleep)
        self.exchange, self.faults = exchange_with(devices)
        self.bus = RealTime(self.wire, self.exchange, self.wire.wait, latency)

    def run(self, until: float) -> None:
        while self.bus.now < until:
            self.bus.serve()

    def send(self, time: float, data: bytes) -> None:
        self.wire.send_at(100.0 + time, data)

    @property
    def times(self) -> list[float]:
        return [at - 100.0 for at, _ in self.wire.received]


def test_replies_are_delivered_together_by_microframes_or_ticks_of_an_adapter(monkeypatch):
    baud = 4_000_000
    assert 2 * 15 * 10 / baud < MICROFRAME
    served = Served(monkeypatch, FakeDevices(IDS, baud=baud), baud=baud)
    served.send(0.01, GROUP)
    served.run(0.02)
    assert [len(data) for _, data in served.wire.received] == [45]
    assert served.times == pytest.approx([0.01 + (17 + 45) * 10 / baud], abs=STEP)
    served = Served(monkeypatch, FakeDevices(IDS), latency=0.016)  # an adapter's ticks
    served.send(0.001, READ)
    served.send(0.033, READ)
    served.run(0.06)
    assert served.times == pytest.approx([0.016, 0.048], abs=STEP)


def test_physics_has_reached_the_end_of_an_instruction_when_it_is_executed(monkeypatch):
    served = Served(monkeypatch, FakeDevices(IDS))
    seen = []
    handle = served.devices.handle
    monkeypatch.setattr(
        served.devices,
        "handle",
        lambda item, *, baud: seen.append(served.devices.now) or handle(item, baud=baud),
    )
    served.send(0.01, READ + READ)
    served.run(0.02)
    assert seen[0] == pytest.approx(0.01 + 14 * BYTE)
    assert seen[1] == pytest.approx(0.01 + (14 + 15 + 14) * BYTE)  # after the reply to the first


def test_a_new_instruction_ends_the_slots_of_a_broadcast_ping(monkeypatch):
    """Replies come 3 ms apart; 4 ms after the ping a read is sent."""
    served = Served(monkeypatch, FakeDevices(IDS, delay=0.003))
    served.send(0.01, protocol2.ping().encode())
    served.send(0.0145, READ)
    served.run(0.05)
    ids = [data[4] for _, data in served.wire.received]
    assert ids == [1, 2]  # the second device replies to the read, not to the ping
    end = 0.0145 + (14 + 15) * BYTE + 0.003
    assert served.times[1] == pytest.approx(end, abs=STEP)


def test_a_reply_that_the_adapter_holds_back_is_late_by_that(monkeypatch):
    served = Served(monkeypatch, FakeDevices(IDS))
    served.faults.line.late_by = 0.02
    served.faults.strike_next(LineFault.LATE, device=2)
    served.send(0.01, GROUP)
    served.run(0.05)
    second = 0.01 + (17 + 2 * 15) * BYTE + 0.02  # what comes behind it waits, too
    assert [data[4] for _, data in served.wire.received] == [1, 2]
    assert served.times == pytest.approx([0.01 + (17 + 15) * BYTE, second], abs=STEP)
    assert len(served.wire.data) == 45


def test_an_idle_port_is_tidied_now_and_then_and_a_used_one_is_not(monkeypatch):
    served = Served(monkeypatch, FakeDevices(IDS, delay=0.05))
    for k in range(10):
        served.send(0.01 + k * IDLE / 2, READ)
    served.run(5 * IDLE)
    assert served.wire.tidied == 0
    served.run(9.5 * IDLE)
    assert 2 <= served.wire.tidied <= 4
