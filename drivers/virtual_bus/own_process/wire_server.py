"""The process of the wire: serves devices whose motors turn in another, until that ends."""

from __future__ import annotations

import contextlib
import sys
import threading
from functools import partial
from multiprocessing.connection import Connection
from operator import is_

from drivers.errors import DriverError
from drivers.virtual_bus.own_process.shared_rows import (
    Measurements,
    SharedRows,
    count_commands,
    count_measurements,
    write_commands,
)
from drivers.virtual_bus.serving.exchange import Physics
from drivers.virtual_bus.serving.server import TimeMode
from drivers.virtual_bus.virtual_ports import VirtualPorts
from drivers.virtual_bus.virtual_robot import VirtualDevices
from robots import Robot

CHECK_PERIOD = 0.2  # s between two looks whether the buses still run


def main(commands: int, measurements: int, descriptor: int) -> None:
    """Serve what the parent describes, by the descriptors of rows and connection; end with it."""
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
        robot = MirroredRobot(described, commands, measurements, powered=powered)
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


class MirroredRobot(VirtualDevices, Physics):
    """The devices of a robot, which pass on commands to the physics and its measurements to them.

    Neither side waits for the other: the newest of both are in shared rows.
    """

    is_light = True

    def __init__(
        self,
        robot: Robot,
        commands: int,
        measurements: int,
        *,
        powered: bool,
    ) -> None:
        """Build the devices; the rows to and from the physics are named by their descriptors."""
        super().__init__(robot, powered=powered)
        self.physics, self.time = self, 0.0
        self._commands = SharedRows(count_commands(robot.n), commands)
        self._measurements = SharedRows(count_measurements(robot.n), measurements)
        self._read = 0  # number of the newest row
        self._published: list[object] = []
        self._imu_time = -1.0
        self._lock = threading.RLock()

    def peek(self, register: str) -> list[int]:
        """Return a register of every servo."""
        return [servo.peek(register) for servo in self.servos]

    def release(self) -> None:
        """Switch torque off, and pass that on at once."""
        for servo in self.servos:
            servo.poke("torque_enable", 0)
        self.advance(self.time)

    def advance(self, to: float) -> None:
        """Advance the devices to a bus time [s]; their motors are where they are."""
        with self._lock:
            self.time = max(self.time, to)
            self._sense()
            for chain in self.chains.values():
                chain.advance(self.time)
            self._publish()

    def _sense(self) -> None:
        row = self._measurements.read(after=self._read)
        if row is None:
            return
        self._read = row[0]
        found = Measurements.read(row[1])
        for servo, measured in zip(self.servos, found.servos, strict=True):
            servo.sense(measured)
        if self.board is not None:
            self.board.sense_voltage(found.voltage)
            self.board.sense_body(found.gyro, found.accelerometer)
        if self.imu is not None and found.imu is not None and found.imu.time != self._imu_time:
            self._imu_time = found.imu.time
            self.imu.sense(found.imu)
            self.on_imu_update()

    def _publish(self) -> None:
        """Publish the motors' commands if one has changed."""
        servos = self.servos
        commands = [servo.motor_command() for servo in servos]
        if len(commands) == len(self._published) and all(map(is_, commands, self._published)):
            return
        self._published = list(commands)
        self._commands.publish(write_commands(commands, [servo.has_profile for servo in servos]))


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
