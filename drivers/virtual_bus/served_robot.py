"""A simulated robot behind serial ports, in real time or in lock-step with its client."""

from __future__ import annotations

import contextlib
import os
import queue
import socket
import subprocess
import sys
import threading
from collections.abc import Callable
from multiprocessing.connection import Connection
from operator import methodcaller
from time import monotonic
from typing import Any

from drivers.dynamixel.robot_ports import find_bus
from drivers.errors import DriverError
from drivers.serial_port import SerialPort
from drivers.twin.simulation import Simulation
from drivers.virtual_bus.imu.virtual_imu import ImuReading
from drivers.virtual_bus.own_process.shared_rows import (
    Measurements,
    SharedRows,
    count_commands,
    count_measurements,
    read_commands,
)
from drivers.virtual_bus.serving.server import PortOptions, TimeMode
from drivers.virtual_bus.servo_physics import HandledRobot, RemoteBoard, RemoteServo, ServoPhysics
from drivers.virtual_bus.virtual_ports import VirtualPorts
from drivers.virtual_bus.virtual_robot import VirtualRobot

LONGEST_START = 60.0  # s
LONGEST_REPLY = 10.0  # s
LONGEST_CATCH_UP = 0.02  # s of physics at once; what is older is lost
REST_PAUSE = 0.008  # s between two advances of a robot at rest
SERVER = "drivers.virtual_bus.own_process.wire_server"


def serve_robot(
    simulation: Simulation,
    *,
    time_mode: TimeMode,
    options: PortOptions | None = None,
    powered: bool = False,
) -> ServedRobot:
    """Serve a simulated robot inside a ``with`` block; raise `SetupError` if it has no bus.

    ``powered`` says whether servos have power from the start, not only once the board switches it.
    """
    if time_mode is TimeMode.REAL_TIME:
        return RealTimeRobot(simulation, powered=powered, options=options)
    return LockStepRobot(VirtualRobot(simulation, powered=powered), options)


class RealTimeRobot(HandledRobot):
    """A virtual robot on serial ports that keep time, inside a ``with`` block.

    Its ports are served by a process of their own, its physics by a thread of this one: replies
    come in time however long this process computes. Motors and sensors are those of the newest
    physics step. Physics that is late falls behind the clock instead of hurrying after it, and
    `behind` says by how much.
    """

    imu = None
    """A driver reads an IMU on I2C at its path."""
    make_port = SerialPort

    def __init__(
        self, simulation: Simulation, *, powered: bool = False, options: PortOptions | None = None
    ) -> None:
        """Prepare to serve a simulated robot; the parameters are those of `VirtualPorts`."""
        robot, has_board = simulation.robot, find_bus(simulation.robot).board is not None
        self.simulation = simulation
        self._paths = dict[str, str]()
        self._setup = robot, options or PortOptions(), powered
        self.behind = 0.0
        """Time by which physics has fallen behind the clock since the start [s]."""
        self._servos = [RemoteServo(joint.servo.id) for joint in robot.joints]
        self._board = RemoteBoard()
        self._reading: ImuReading | None = None  # of an IMU on a line of its own
        self._commands = SharedRows(count_commands(robot.n))
        self._measurements = SharedRows(count_measurements(robot.n))
        self._read = 0  # number of the newest commands
        board = self._board if has_board else None
        self.physics = ServoPhysics(simulation, self._servos, board, rests=True)
        self._connect_imu()
        self.physics.on_sense.append(self._publish)
        self._replies = queue.Queue[Any]()
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name="virtual robot", daemon=True)

    @property
    def paths(self) -> dict[str, str]:
        """Return the path of each port by its name in robot.toml, that of the IMU included.

        Raises:
            DriverError: if a port cannot be created; OSError: if its folder cannot.
        """
        if not self._paths:
            self._paths |= self._await_reply(LONGEST_START)
        return self._paths

    @property
    def pid(self) -> int:
        """Return the number of the process of its wire."""
        return self._process.pid

    @property
    def running(self) -> bool:
        """Return whether its ports are served."""
        return self._thread.is_alive() and self._process.poll() is None

    def peek(self, register: str) -> list[int]:
        """Return a register of every servo, in the order of the joints."""
        return self._ask(methodcaller("peek", register))

    def rearrange(self, change: Callable[[Simulation], None], *, releases: bool = False) -> None:
        """Change the simulation by hand."""
        if releases:
            self._ask(methodcaller("release"))
            self._receive_commands()
        self.physics.rearrange(change)

    def __enter__(self) -> RealTimeRobot:
        """Start the process; its ports are there when `paths` returns."""
        ours, theirs = socket.socketpair()
        rows = self._commands.descriptor, self._measurements.descriptor
        shared = (*rows, theirs.fileno())
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-m", SERVER, *map(str, shared)],
            env={**os.environ, "PYTHONPATH": os.pathsep.join(map(os.path.abspath, sys.path))},
            pass_fds=shared,
            stdin=subprocess.DEVNULL,
            start_new_session=True,  # Ctrl-C is for this process, which ends it
            stdout=subprocess.DEVNULL,
        )
        theirs.close()
        self._connection = Connection(ours.detach())
        self._connection.send(self._setup)
        self._thread.start()
        return self

    def __exit__(self, *error: object) -> None:
        self._stopping.set()
        self._thread.join()
        self._connection.close()  # which ends it
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(LONGEST_REPLY)
        self._process.kill()
        self._process.wait()
        self._commands.close()
        self._measurements.close()

    def _ask(self, call: methodcaller) -> Any:
        """Call a method of the robot in the other process once it serves; return its result."""
        _ = self.paths
        with contextlib.suppress(OSError):  # of a process that has ended: its last reply says so
            self._connection.send(call)
        return self._await_reply(LONGEST_REPLY)

    def _await_reply(self, longest: float) -> Any:
        """Wait for the next reply, some time [s] at most; raise what ended the process."""
        try:
            reply = self._replies.get(timeout=longest)
        except queue.Empty:
            raise DriverError(f"the virtual bus does not answer within {longest:g} s") from None
        if isinstance(reply, DriverError | OSError):
            raise reply
        return reply

    # Physics ------------------------------------------------------------------------------------

    def _run(self) -> None:
        start = monotonic() - self.physics.time
        try:
            while not self._stopping.is_set():
                self._receive()
                late = monotonic() - start - self.physics.time - LONGEST_CATCH_UP
                if late > 0.0:
                    start += late
                    self.behind += late
                self._receive_commands()
                self.physics.advance(monotonic() - start)
                step = self.simulation.model.opt.timestep
                pause = REST_PAUSE if self.physics.is_at_rest else step
                self._stopping.wait(max(start + self.physics.time + pause - monotonic(), 0.0))
        finally:
            self._replies.put(DriverError("the virtual bus stopped unexpectedly"))

    def _receive(self) -> None:
        try:
            while self._connection.poll():
                self._replies.put(self._connection.recv())
        except (EOFError, OSError):  # it has ended
            self._stopping.set()

    def _receive_commands(self) -> None:
        row = self._commands.read(after=self._read)
        if row is None:
            return
        self._read = row[0]
        for servo, (command, has_profile) in zip(self._servos, read_commands(row[1]), strict=True):
            servo.has_profile = has_profile
            if command != servo.command:  # an equal one stays the same object
                servo.command = command

    def _publish(self) -> None:
        found = Measurements(
            servos=[servo.measured for servo in self._servos],
            **vars(self._board),
            imu=self._reading,
        )
        self._measurements.publish(found.write())

    def _connect_imu(self) -> None:
        """Measure for an IMU on a line of its own, which is in the other process."""
        robot = self.simulation.robot
        if robot.imu is None or not robot.imu.has_own_line:
            return

        def sense() -> None:
            self._reading = ImuReading.of(self.simulation, self.physics.time)

        self.simulation.on_sensor_update.append(sense)
        sense()


class LockStepRobot(VirtualPorts, HandledRobot):
    """A virtual robot that waits for its client."""

    behind = 0.0
    """The clock waits for physics."""

    def __init__(self, robot: VirtualRobot, options: PortOptions | None = None) -> None:
        """Prepare its ports."""
        super().__init__(robot, time_mode=TimeMode.LOCK_STEP, options=options)
        self._virtual = robot

    def rearrange(self, change: Callable[[Simulation], None], *, releases: bool = False) -> None:
        """Change the simulation by hand, between two instructions."""
        self.main.call(lambda: self._virtual.rearrange(change, releases=releases))


ServedRobot = RealTimeRobot | LockStepRobot
"""A robot whose ports are served inside a ``with`` block."""
