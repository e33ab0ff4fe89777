"""In lock-step, bus time is what the client's requests make of it, and no reply is late."""

import time

import pytest
from bus_stories import serving
from fake_devices import FakeDevices
from fake_wire import FakeWire, exchange_with
from fault_injector import LineFault
from hypothesis import given
from hypothesis import strategies as st

from drivers import Command
from drivers.dynamixel import protocol2
from drivers.dynamixel.protocol2 import Damaged, Instruction, Packet, Span
from drivers.virtual_bus.devices.chain import Chain, CycleEnd
from drivers.virtual_bus.serving.lock_step import QUIET, LockStep

IDS = (1, 2, 3)
PERIOD = 0.008  # s
GOALS = protocol2.sync_write(116, dict.fromkeys(IDS, bytes(4))).encode()
READ = protocol2.read(2, Span(132, 4)).encode()
GROUP = protocol2.sync_read(IDS, Span(132, 4)).encode()


class Served:
    def __init__(self, seed: int = 0) -> None:
        self.wire, self.devices = FakeWire(), FakeDevices(IDS)
        self.exchange, self.faults = exchange_with(self.devices, seed)
        self.bus = LockStep(self.wire, self.exchange, self.wire.wait)

    def ask(self, data: bytes) -> bytes:
        before = len(self.wire.data)
        self.wire.send_at(self.wire.now, data)
        self.bus.serve()
        return self.wire.data[before:]


@given(seed=st.integers(0, 1000), late=st.floats(0.0, 1.0), split=st.floats(0.0, 1.0))
def test_late_and_split_replies_come_whole_and_in_order(seed: int, late: float, split: float):
    requests = [GROUP, READ, GOALS, GROUP, protocol2.ping(3).encode(), GOALS]
    plain, disturbed = Served(), Served(seed)
    disturbed.faults.set_rate(LineFault.LATE, late)
    disturbed.faults.set_rate(LineFault.SPLIT, split)
    for request in requests:
        plain.ask(request)
        disturbed.ask(request)
    disturbed.faults.set_rate(LineFault.LATE, 0.0)
    disturbed.faults.set_rate(LineFault.SPLIT, 0.0)
    for _ in range(30):
        disturbed.ask(GOALS)
    assert disturbed.wire.data == plain.wire.data


def test_a_cycle_takes_one_period_and_a_late_reply_the_time_of_a_missing_one():
    served = Served()
    assert len(served.ask(GROUP + READ)) == 4 * 15
    assert served.exchange.time == 0.0
    assert served.ask(GOALS) == b""
    assert served.exchange.time == served.devices.now == PERIOD
    served = Served()
    served.faults.line.late_by = 1.5 * QUIET
    served.faults.strike_next(LineFault.LATE)
    assert served.ask(READ) == b""
    assert served.exchange.time == pytest.approx(QUIET)
    assert len(served.ask(protocol2.ping(1).encode())) == 15 + 14
    assert served.exchange.time == pytest.approx(2 * QUIET)


@pytest.mark.parametrize("is_abandoned", [True, False])
def test_what_was_held_back_for_a_client_that_has_gone_is_dropped(is_abandoned: bool):
    served = Served()
    served.faults.strike_next(LineFault.LATE)
    served.ask(READ)
    served.wire.is_abandoned = is_abandoned
    served.bus.serve()
    assert served.wire.tidied == 1
    served.exchange.pass_until(1.0)
    assert len(served.ask(protocol2.ping(1).encode())) == (14 if is_abandoned else 15 + 14)


@given(address=st.integers(0, 200), length=st.integers(0, 200))
def test_a_cycle_ends_where_a_sync_write_covers_the_whole_goal(address: int, length: int):
    """Goal Position is at 116 to 119 (e-manual)."""
    rows = address.to_bytes(2, "little") + length.to_bytes(2, "little") + bytes(length + 1)
    covers = set(range(116, 120)) <= set(range(address, address + length))
    assert CycleEnd.of(()).is_ended_by(Packet(0xFE, Instruction.SYNC_WRITE, rows)) == covers
    assert not CycleEnd.of(()).is_ended_by(Packet(0xFE, Instruction.BULK_WRITE, rows))
    assert not CycleEnd.of(()).is_ended_by(Damaged(0xFE, Instruction.SYNC_WRITE, rows))


# The client's port -------------------------------------------------------------------------------


def test_a_bus_without_a_processor_loses_no_reply(tiny, monkeypatch):
    handle, left = Chain.handle, [0]

    def handle_late(self, *arguments, **named):
        if left[0]:
            left[0] -= 1
            time.sleep(0.3)  # longer than a driver waits
        return handle(self, *arguments, **named)

    monkeypatch.setattr(Chain, "handle", handle_late)
    with serving(tiny) as served, served.make_driver() as driver:
        state = driver.read()
        driver.write(Command.position(tiny, state.joint_pos))
        left[0] = 1
        driver.read()
        assert [line.lost for line in driver.statistics.values()] == [0]


def test_what_does_not_come_is_not_waited_for(tiny):
    with serving(tiny) as served:
        port = served.make_port(served.path)
        port.open()
        begin = time.monotonic()
        port.write(protocol2.ping(250).encode())  # a ping of an id that is not there
        assert port.read(begin + 1000.0) == b""
        port.close()
    assert time.monotonic() - begin < 100.0, "it ended before the deadline"
