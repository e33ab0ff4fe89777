"""In lock-step a reply is missing once the bus is done, and not because a computer is busy."""

import time

import pytest

from drivers import Command
from drivers.dynamixel import protocol2
from drivers.dynamixel.backend import DriverOptions, DynamixelBackend
from drivers.dynamixel.clock import CycleClock
from drivers.twin.simulation import Simulation
from drivers.virtual_bus import TimeMode, VirtualPorts, VirtualRobot
from drivers.virtual_bus.devices.chain import Chain
from drivers.virtual_bus.virtual_ports import LockStepPort
from robots import Robot

BUSY = 0.3  # s for which the computer has no time for the bus: longer than a driver waits


@pytest.fixture
def ports(tiny: Robot):
    virtual = VirtualRobot(Simulation(tiny), powered=True)
    with VirtualPorts(virtual, time_mode=TimeMode.LOCK_STEP) as ports:
        yield ports


def test_a_bus_without_a_processor_loses_no_reply(tiny, ports, monkeypatch):
    handle, left = Chain.handle, [0]

    def handle_late(self, *arguments, **named):
        if left[0]:
            left[0] -= 1
            time.sleep(BUSY)
        return handle(self, *arguments, **named)

    monkeypatch.setattr(Chain, "handle", handle_late)
    options = DriverOptions(make_port=ports.make_port)
    with DynamixelBackend(tiny, ports.paths, clock=CycleClock(), options=options) as driver:
        state = driver.read()
        driver.write(Command.position(tiny, state.joint_pos))
        left[0] = 1
        driver.read()
        assert [line.lost for line in driver.statistics.values()] == [0]


def test_what_does_not_come_is_not_waited_for(ports):
    port = ports.make_port(ports.main.path, 1_000_000)
    assert isinstance(port, LockStepPort)
    port.open()
    try:
        begin = time.monotonic()
        port.write(protocol2.ping(250).encode())  # a ping of an id that is not there
        assert port.read(begin + 1000.0) == b""
    finally:
        port.close()
    assert time.monotonic() - begin < 100.0, "it ended before the deadline"
