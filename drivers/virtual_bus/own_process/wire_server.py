"""The process of the wire: serves the ports of a robot until its parent ends."""

from __future__ import annotations

import contextlib
import sys
import threading
from functools import partial
from multiprocessing.connection import Connection
from typing import Any

from drivers.errors import DriverError
from drivers.virtual_bus.own_process.messages import (
    Count,
    Peek,
    PhysicsRequest,
    TorqueOff,
)
from drivers.virtual_bus.own_process.mirrored_robot import MirroredRobot
from drivers.virtual_bus.serving.server import TimeMode
from drivers.virtual_bus.virtual_ports import VirtualPorts

CHECK_PERIOD = 0.2  # s between two looks whether the buses still run


def main(commands: int, measurements: int, descriptor: int) -> None:
    """Serve what the parent describes; end with it.

    Args:
        commands: Descriptor of the rows of commands.
        measurements: Descriptor of the rows of measurements.
        descriptor: Descriptor of the connection to the parent.
    """
    line = Line(Connection(descriptor))
    try:
        setup = line.receive()
    except EOFError:
        return

    def request(name: str, *values: float) -> None:
        line.send(PhysicsRequest(name=name, values=values))

    try:
        robot = MirroredRobot(
            setup.robot,
            commands,
            measurements,
            request,
            powered=setup.powered,
            quirks=setup.quirks,
        )
        ports = VirtualPorts(robot, time_mode=TimeMode.REAL_TIME, options=setup.options)
        with ports:
            line.send(ports.paths)
            _serve(line, robot, ports)
    except (DriverError, OSError) as error:  # also a folder that cannot be made
        line.send(error)


class Line:
    """The connection to the parent; any thread may send."""

    def __init__(self, connection: Connection) -> None:
        self._connection, self._lock = connection, threading.Lock()

    def send(self, message: object) -> None:
        """Send a message, unless the parent has ended."""
        with self._lock, contextlib.suppress(OSError):
            self._connection.send(message)

    def receive(self) -> Any:
        """Wait for a message.

        Raises:
            EOFError: if the parent has ended.
        """
        try:
            return self._connection.recv()
        except OSError as error:
            raise EOFError from error

    def has_message(self, within: float) -> bool:
        """Wait for a message, some time [s] at most; return whether there is one, or the end."""
        return self._connection.poll(within)


def _serve(line: Line, robot: MirroredRobot, ports: VirtualPorts) -> None:
    """Answer the parent until it ends, or a bus does."""
    while ports.running:
        if not line.has_message(CHECK_PERIOD):
            continue
        try:
            asked = line.receive()
        except EOFError:
            return
        if isinstance(asked, TorqueOff):
            ports.main.call(robot.release)
            line.send(asked)
        elif isinstance(asked, Peek):
            line.send(ports.main.call(partial(robot.peek, asked.name)))
        elif isinstance(asked, Count):
            line.send({name: bus.statistics for name, bus in ports.buses.items()})


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
