"""The process of the wire: serves the ports of a robot until its parent ends."""

from __future__ import annotations

import sys
from functools import partial
from multiprocessing.connection import Connection

from drivers.errors import DriverError
from drivers.virtual_bus.own_process.messages import (
    Count,
    Peek,
    PhysicsRequest,
    TorqueOff,
    WireSetup,
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
    connection = Connection(descriptor)
    setup: WireSetup = connection.recv()

    def request(name: str, *values: float) -> None:
        connection.send(PhysicsRequest(name=name, values=values))

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
            connection.send(ports.paths)
            _serve(connection, robot, ports)
    except DriverError as error:
        connection.send(error)


def _serve(connection: Connection, robot: MirroredRobot, ports: VirtualPorts) -> None:
    """Answer the parent until it ends, or a bus does."""
    while ports.running:
        if not connection.poll(CHECK_PERIOD):
            continue
        try:
            asked = connection.recv()
        except (EOFError, OSError):
            return
        if isinstance(asked, TorqueOff):
            ports.main.call(robot.release)
            connection.send(asked)
        elif isinstance(asked, Peek):
            connection.send(ports.main.call(partial(robot.peek, asked.name)))
        elif isinstance(asked, Count):
            connection.send({name: bus.statistics for name, bus in ports.buses.items()})


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
