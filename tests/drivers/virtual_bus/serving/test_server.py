"""The virtual bus answers in time, keeps time with its client, and always ends cleanly."""

import os
import threading
from pathlib import Path

import pytest
import serial
from fake_devices import FakeDevices
from still_physics import StillPhysics
from waiting import LONGEST_WAIT, wait_until

from drivers.dynamixel import protocol2
from drivers.dynamixel.protocol2 import Instruction, Packet, Span
from drivers.errors import DriverError
from drivers.real_time_class import in_real_time_class
from drivers.virtual_bus.serving.server import TimeMode, VirtualBus

IDS = (1, 2, 3)
GOALS = protocol2.sync_write(116, dict.fromkeys(IDS, bytes(4))).encode()


@pytest.fixture
def devices():
    return FakeDevices(IDS)


@pytest.fixture(params=TimeMode)
def time_mode(request) -> TimeMode:
    return request.param


@pytest.fixture
def bus(devices: FakeDevices, time_mode: TimeMode):
    with VirtualBus(devices, StillPhysics(devices), time_mode=time_mode) as bus:
        yield bus


def connect(bus: VirtualBus, baud: int = 1_000_000, timeout: float = LONGEST_WAIT) -> serial.Serial:
    return serial.Serial(bus.path, baud, timeout=timeout)


def ask(port: serial.Serial, request: bytes, count: int) -> bytes:
    port.write(request)
    return port.read(count)


def test_in_real_time_its_thread_is_in_the_real_time_class(bus: VirtualBus, time_mode: TimeMode):
    with in_real_time_class() as is_permitted:
        pass
    found = bus.call(lambda: os.sched_getscheduler(0)) & ~os.SCHED_RESET_ON_FORK
    is_expected = is_permitted and time_mode is TimeMode.REAL_TIME
    assert found == (os.SCHED_FIFO if is_expected else os.SCHED_OTHER)


def test_a_client_at_the_wrong_rate_is_not_heard(devices: FakeDevices, bus: VirtualBus):
    with connect(bus, 57600) as port:
        port.write(protocol2.ping(1).encode())
        wait_until(lambda: bus.statistics.wrong_baud == 1)
        assert bus.statistics.bytes_out == 0
    with connect(bus) as port:
        assert ask(port, protocol2.ping(1).encode(), 14)[:4] == b"\xff\xff\xfd\x00"
    assert bus.statistics.wrong_baud == 1
    assert devices.heard == [Packet(1, Instruction.PING)]


@pytest.mark.parametrize("time_mode", [TimeMode.LOCK_STEP])
def test_the_books_balance(bus: VirtualBus):
    read = protocol2.sync_read(IDS, Span(126, 10)).encode()
    with connect(bus) as port:
        for _ in range(10):
            assert len(ask(port, GOALS + read, 63)) == 63
        message = bus.statistics
    assert message.bytes_in == 10 * (len(GOALS) + len(read))
    assert message.bytes_out == 10 * 63
    assert (message.packets, message.answers) == (20, 30)
    assert (message.noise, message.damaged, message.overflow, message.unanswered) == (0, 0, 0, 0)


def test_a_client_that_never_reads_does_not_hold_the_bus_up(bus: VirtualBus):
    read = protocol2.read(1, Span(0, 250)).encode()
    with connect(bus) as port:
        for _ in range(400):
            port.write(read)
        # Those that a busy machine delivers in two parts, too far apart, are broken off.
        wait_until(lambda: bus.statistics.answers + bus.statistics.broken_off == 400)
        wait_until(lambda: bus.statistics.overflow > 0)
        message = bus.statistics
        assert message.bytes_out + message.overflow <= 400 * 261


class BrokenDevices(FakeDevices):
    def handle(self, *_, **__):
        raise RuntimeError("a servo melted")


def test_what_goes_wrong_in_the_thread_is_raised_by_stop_and_only_once(time_mode: TimeMode):
    devices = BrokenDevices(IDS)
    bus = VirtualBus(devices, StillPhysics(devices), time_mode=time_mode).start()
    path = bus.path
    with connect(bus) as port:
        port.write(protocol2.ping(1).encode())
        wait_until(lambda: not bus.running)
        assert not os.path.lexists(path)  # its clients see an unplugged port
    with pytest.raises(RuntimeError, match="a servo melted"):
        bus.stop()
    bus.stop()


def test_stop_takes_port_and_thread_away_and_may_be_repeated(devices: FakeDevices, time_mode):
    threads, ends = threading.active_count(), len(list(Path("/proc/self/fd").iterdir()))
    bus = VirtualBus(devices, StillPhysics(devices), time_mode=time_mode)
    bus.stop()  # not even started
    with pytest.raises(DriverError, match="start it first"):
        _ = bus.path
    with pytest.raises(DriverError, match="not running"):
        bus.unplug()
    bus.start()
    path = bus.path
    bus.stop()
    bus.stop()
    assert not os.path.lexists(path)
    assert threading.active_count() == threads
    assert len(list(Path("/proc/self/fd").iterdir())) == ends
    with pytest.raises(DriverError, match="runs once"):
        bus.start()


def test_a_call_runs_between_two_instructions_and_its_error_is_the_callers(bus: VirtualBus):
    assert bus.call(lambda: threading.current_thread().name) == "virtual bus"
    assert bus.call(lambda: bus.call(lambda: 7)) == 7  # also from within
    with pytest.raises(ZeroDivisionError):
        bus.call(lambda: 1 // 0)
    assert bus.running
    bus.stop()
    assert bus.call(lambda: threading.current_thread()) is threading.main_thread()
