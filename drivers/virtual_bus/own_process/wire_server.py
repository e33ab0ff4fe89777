"""The process of the wire: serves the ports of a robot until its parent ends."""

from __future__ import annotations

import contextlib
import sys
import threading
from functools import partial
from multiprocessing.connection import Connection

from drivers.errors import DriverError
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
    connection, lock = Connection(descriptor), threading.Lock()

    def send(message: object) -> None:
        """Send a message from any thread, unless the parent has ended."""
        with lock, contextlib.suppress(OSError):
            connection.send(message)

    try:
        described, options, powered = connection.recv()
    except (EOFError, OSError):
        return
    try:
        robot = MirroredRobot(described, commands, measurements, send, powered=powered)
        with VirtualPorts(robot, time_mode=TimeMode.REAL_TIME, options=options) as ports:
            send(ports.paths)
            while ports.running:
                if not connection.poll(CHECK_PERIOD):
                    continue
                try:
                    asked = connection.recv()  # a call of a method
                except (EOFError, OSError):
                    return
                send(ports.main.call(partial(asked, robot)))
    except (DriverError, OSError) as error:  # also a folder that cannot be made
        send(error)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
