"""The digital twin: a backend whose robot is a MuJoCo simulation."""

from __future__ import annotations

import copy

import numpy as np

from drivers.backend import Backend, Release
from drivers.errors import NoImuError, NotConnectedError
from drivers.imu.fusion import OrientationFilter
from drivers.servo_units import ServoUnits
from drivers.state import Command, State, check_command
from drivers.twin.device_models import CURRENT_STEP, VELOCITY_STEP, VOLTAGE_STEP, quantize
from drivers.twin.simulation import CompiledWorld, Simulation
from robots import Posture, Robot
from robots.arguments import expect
from robots.servo import LimitMode
from robots.torque_limit import Drive, limit_servos


class Twin(Backend):
    """Simulates a robot that measures and moves like the real one.

    Time passes in ``write``: each call holds the command for one period of physics, so the
    twin runs in lock-step with its controller, as fast as the machine can. ``read`` changes
    nothing. ``truth`` is for judges.
    """

    def __init__(
        self,
        world: CompiledWorld | Robot,
        start: Posture | None = None,
        *,
        voltage: float | None = None,
        limit_by: LimitMode | None = None,
        without_imu: bool = False,
    ) -> None:
        """Build a twin, torque off; what is not listed here is as in `Simulation`.

        Args:
            start: Where the robot is, at rest; ``None`` for its standing posture.
            limit_by: What torque limits act on; ``None`` for the robot's own.
            without_imu: Measure neither angular velocity nor orientation.

        Raises:
            NoImuError: if the robot has no IMU and should measure with it.
            ValueError: if world or start are of another type.
        """
        expect("world", world, Robot | CompiledWorld, "a Robot or a World, e.g. World(robot)")
        expect("start", start, Posture | None, "a Posture, e.g. fall.posture")
        self.simulation = Simulation(world, voltage=voltage)
        self.robot, self.period = self.simulation.robot, self.simulation.period
        self.model, self.data = self.simulation.model, self.simulation.data
        self.truth = self.simulation.truth
        self._units = ServoUnits(self.robot)
        steps = np.full(self.robot.n, VELOCITY_STEP)
        self._velocity_step = self.robot.transmission.motion_at_actuator(steps)
        self.limit_by: LimitMode = limit_by or self.robot.limit_by
        if self.robot.imu_site is None and not without_imu:
            raise NoImuError(self.robot.name)
        self._filter = None if without_imu else OrientationFilter(self.period)
        self._connected = False
        self._limits: tuple[LimitMode, np.ndarray, Drive | None] = self.limit_by, np.zeros(0), None
        if start is not None:
            self.place(start)

    def __repr__(self) -> str:
        return f"Twin({self.robot.name}, {self.robot.n} joints)"

    def place(self, posture: Posture) -> None:
        """Place the robot at rest, cool, torque off, and start its clock at 0."""
        self.simulation.place(posture)
        self._start_filter()

    def copy(self) -> Twin:
        """Return another twin in the same state, disconnected."""
        twin, robot = copy.copy(self), self.robot
        twin.simulation = body = copy.deepcopy(self.simulation, {id(robot): robot})
        twin.model, twin.data, twin.truth = body.model, body.data, body.truth
        twin._filter = OrientationFilter(self.period) if self._filter else None
        twin._start_filter()
        twin._connected = False
        return twin

    def connect(self) -> None:
        """Start the orientation filter; the robot stays where it is."""
        if not self._connected:
            self._start_filter()
        self._connected = True

    def close(self) -> None:
        """Release every joint, unless ``release`` says otherwise."""
        if self.release is Release.LIMP:
            self.simulation.release()
        self._connected = False

    def read(self) -> State:
        """Measure the robot through its sensors."""
        self._check_connected()
        body, transmission = self.simulation, self.robot.transmission
        time, angle, speed, current = body.time, body.joint_pos, body.joint_vel, body.joint_current
        temperature = body.temperature
        return State(
            time=time,
            joint_pos=self._units.quantize(angle),
            joint_vel=transmission.to_joint(
                quantize(transmission.to_actuator(speed), self._velocity_step)
            ),
            joint_current=quantize(current, CURRENT_STEP),
            gyro=body.imu.gyro if self._filter else np.zeros(0),
            orientation=self._filter.orientation if self._filter else np.zeros(0),
            temperature=np.rint(temperature),
            voltage=round(body.voltage / VOLTAGE_STEP) * VOLTAGE_STEP,
        )

    def write(self, command: Command) -> Command:
        """Hold a command for one period of physics; return it with the servos' limits on it.

        Goals are whole ticks, as on a servo.
        """
        self._check_connected()
        check_command(command, self.robot.joint_names)
        drive = self._limit_servos(command)
        limit = np.minimum(command.torque_limit, self.robot.max_torque)
        sent = Command(
            joint_pos=self._units.round_goal(command.joint_pos),
            gain_scale=command.gain_scale,
            torque_limit=np.minimum(limit, drive.torque),
            pwm_limit=drive.pwm,
        )
        body = self.simulation
        body.drive(sent.joint_pos, drive)
        body.step(body.steps_per_period)
        body.update_sensors(self.period)
        if self._filter:
            self._filter.update(body.imu.gyro, body.imu.accelerometer, self.period)
        return sent

    def _limit_servos(self, command: Command) -> Drive:
        """Return the limits of the servos, which are kept while those of the commands are."""
        asked = np.array([command.torque_limit, command.gain_scale, command.pwm_limit])
        mode, kept, drive = self._limits
        if drive is None or mode != self.limit_by or not np.array_equal(asked, kept):
            drive = limit_servos(
                self.robot,
                np.minimum(asked[0], self.robot.max_torque),
                self.limit_by,
                gain_scale=asked[1],
                pwm_limit=asked[2],
            )
            self._limits = self.limit_by, asked, drive
        return drive

    def _start_filter(self) -> None:
        if self._filter:
            self._filter.start(self.simulation.imu.accelerometer)

    def _check_connected(self) -> None:
        if not self._connected:
            raise NotConnectedError(f"twin of {self.robot.name}")
