"""In lock-step a reply is missing once the bus is done, and not because a computer is busy."""

import time

import pytest

from drivers import Command
from drivers.dynamixel import protocol2
from drivers.dynamixel.backend import DriverOptions, DynamixelBackend
from drivers.dynamixel.clock import CycleClock
from drivers.serial_port import SerialPort
from drivers.twin.simulation import Simulation
from drivers.virtual_bus import TimeMode, VirtualPorts, VirtualRobot
from drivers.virtual_bus.devices.chain import Chain
from drivers.virtual_bus.serving.lock_step_port import LockStepPort
from robots import Robot

BUSY = 0.3  # s for which the computer has no time for the bus: longer than a driver waits


@pytest.fixture
def ports(tiny: Robot):
    virtual = VirtualRobot(Simulation(tiny), powered=True)
    with VirtualPorts(virtual, time_mode=TimeMode.LOCK_STEP) as ports:
        yield ports


def connect(tiny: Robot, ports: VirtualPorts, make_port=None) -> DynamixelBackend:
    options = DriverOptions(make_port=make_port or ports.make_port)
    return DynamixelBackend(tiny, ports.paths, clock=CycleClock(), options=options)


@pytest.mark.parametrize("waits_for_the_bus", [True, False])
def test_a_bus_without_a_processor_loses_no_reply(tiny, ports, monkeypatch, waits_for_the_bus):
    make_port = None if waits_for_the_bus else SerialPort
    handle, left = Chain.handle, [0]

    def handle_late(self, *arguments, **named):
        if left[0]:
            left[0] -= 1
            time.sleep(BUSY)
        return handle(self, *arguments, **named)

    monkeypatch.setattr(Chain, "handle", handle_late)
    with connect(tiny, ports, make_port) as driver:
        state = driver.read()
        driver.write(Command.position(tiny, state.joint_pos))
        left[0] = 1
        driver.read()
        lost = sum(line.lost for line in driver.statistics.values())
    assert (lost == 0) == waits_for_the_bus


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
