"""The side of the wire: devices whose motors turn in another process."""

from __future__ import annotations

import threading
from collections.abc import Callable
from operator import is_, methodcaller

from drivers.virtual_bus.own_process.shared_rows import (
    Measurements,
    SharedRows,
    count_commands,
    count_measurements,
    write_commands,
)
from drivers.virtual_bus.serving.physics import Physics
from drivers.virtual_bus.virtual_robot import VirtualDevices
from robots import Robot

PERIOD = 0.008  # s of a control period, for faults of a schedule


class MirroredRobot(VirtualDevices):
    """The devices of a robot, and rows to and from the physics behind them."""

    def __init__(
        self,
        robot: Robot,
        commands: int,
        measurements: int,
        request: Callable[[methodcaller], None],
        *,
        powered: bool,
    ) -> None:
        """Build the devices; the rows to and from the physics are named by their descriptors."""
        super().__init__(robot, powered=powered)
        self.physics: MirroredPhysics = MirroredPhysics(
            self,
            SharedRows(count_commands(robot.n), commands),
            SharedRows(count_measurements(robot.n), measurements),
            request,
        )

    def peek(self, register: str) -> list[int]:
        """Return a register of every servo."""
        return [servo.peek(register) for servo in self.servos]

    def release(self) -> None:
        """Switch torque off, and pass that on at once."""
        for servo in self.servos:
            servo.poke("torque_enable", 0)
        self.physics.advance(self.physics.time)


class MirroredPhysics(Physics):
    """Passes the newest commands to the physics and its newest measurements to the devices."""

    is_light = True

    def __init__(
        self,
        robot: VirtualDevices,
        commands: SharedRows,
        measurements: SharedRows,
        request: Callable[[methodcaller], None],
    ) -> None:
        self.time = 0.0
        self._robot, self._request = robot, request
        self._commands, self._measurements = commands, measurements
        self._read = 0  # number of the newest row
        self._published: list[object] = []
        self._imu_time = -1.0
        self._lock = threading.RLock()

    def advance(self, to: float) -> None:
        """Advance the devices to a bus time [s]; their motors are where they are."""
        with self._lock:
            self.time = max(self.time, to)
            self._sense()
            for chain in self._robot.chains.values():
                chain.advance(self.time)
            self._publish()

    def pass_period(self) -> None:
        """Advance by one control period."""
        self.advance(self.time + PERIOD)

    def heat(self, servo_id: int, temperature: float) -> None:
        """Set the temperature of a servo [°C]."""
        if servo_id not in [servo.id for servo in self._robot.servos]:
            raise ValueError(f"no servo has id {servo_id}")
        self._request(methodcaller("heat", servo_id, temperature))

    def sag(self, voltage: float) -> None:
        """Set the supply voltage [V]."""
        self._request(methodcaller("sag", voltage))

    def _sense(self) -> None:
        """Give the newest measurements to the devices."""
        row = self._measurements.read(after=self._read)
        if row is None:
            return
        self._read, robot = row[0], self._robot
        found = Measurements.read(row[1])
        for servo, measured in zip(robot.servos, found.servos, strict=True):
            servo.sense(measured)
            servo.late = found.late
        if robot.board is not None:
            robot.board.sense_voltage(found.voltage)
            robot.board.sense_body(found.gyro, found.accelerometer)
        if robot.imu is not None and found.imu is not None and found.imu.time != self._imu_time:
            self._imu_time = found.imu.time
            robot.imu.sense(found.imu)
            robot.on_imu_update()

    def _publish(self) -> None:
        """Publish the motors' commands if one has changed."""
        servos = self._robot.servos
        commands = [servo.motor_command() for servo in servos]
        if len(commands) == len(self._published) and all(map(is_, commands, self._published)):
            return
        self._published = list(commands)
        self._commands.publish(write_commands(commands, [servo.has_profile for servo in servos]))
