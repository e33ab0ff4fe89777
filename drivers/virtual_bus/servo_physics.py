"""Couples the registers of virtual servos to a MuJoCo simulation."""

from __future__ import annotations

import threading
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from operator import is_

import numpy as np

from drivers.servo_units import ServoUnits
from drivers.twin.simulation import Simulation
from drivers.virtual_bus.devices.board import VirtualBoard
from drivers.virtual_bus.devices.motor_servo import MotorCommand
from drivers.virtual_bus.devices.plain_servo import PlainServo
from drivers.virtual_bus.devices.sensors import Measured
from drivers.virtual_bus.devices.servo import VirtualServo
from robots import Posture
from robots.quaternion import Array
from robots.torque_limit import Drive

REST_SPEED = 0.01  # m/s and rad/s, of a robot that lies still
REST_TIME = 0.5  # s without torque and motion after which it is simulated no further


class RemoteServo:
    """Motor and sensors of a servo in another process, where its clock is."""

    def __init__(self, servo_id: int) -> None:
        self.id = servo_id
        self.measured = Measured()
        self.has_profile = False
        self.command = MotorCommand()  # as long as it has sent none

    def motor_command(self) -> MotorCommand:
        """Return its newest command."""
        return self.command

    def sense(self, measured: Measured) -> None:
        """Measure."""
        self.measured = measured

    def advance(self, now: float) -> None:
        """Do nothing."""


class RemoteBoard:
    """Sensors of a board in another process."""

    def __init__(self) -> None:
        self.voltage, self.gyro, self.accelerometer = 0.0, np.zeros(3), np.zeros(3)

    def sense_voltage(self, voltage: float) -> None:
        """Measure the supply [V]."""
        self.voltage = voltage

    def sense_body(self, gyro: Array, accelerometer: Array) -> None:
        """Measure rates [rad/s] and forces [m/s²], (3,) each."""
        self.gyro, self.accelerometer = gyro, accelerometer

    def advance(self, now: float) -> None:
        """Do nothing."""


class HandledRobot(ABC):
    """A simulated robot that a person places, holds and turns."""

    @abstractmethod
    def rearrange(self, change: Callable[[Simulation], None], *, releases: bool = False) -> None:
        """Change the simulation by hand; switch torque off before where that ``releases`` it."""

    def place(self, posture: Posture) -> None:
        """Place the robot at rest, cool, torque off."""
        self.rearrange(lambda body: body.place(posture), releases=True)

    def hold(self, posture: Posture) -> None:
        """Place the robot at rest, cool, torque off, held by a person."""
        self.rearrange(lambda body: body.hold(posture), releases=True)

    def turn(self, joint: int, by: float) -> None:
        """Turn a joint by an angle [rad], as a person does; see `Simulation.turn`."""
        self.rearrange(lambda body: body.turn(joint, by))

    def let_go(self) -> None:
        """Let a robot go that is held."""
        self.rearrange(Simulation.let_go)


class ServoPhysics:
    """Advances a simulation whose joints are driven by servos' registers.

    Before each run of physics steps the servos' motor commands are applied; after it their
    sensors are updated. The position loops are the simulation's own, so a robot behind the bus
    moves as its twin does, bit for bit. Of their gains, only P has an effect, and D in
    current-based position mode. Thread-safe.
    """

    is_light = False

    def __init__(
        self,
        simulation: Simulation,
        servos: Sequence[VirtualServo | PlainServo | RemoteServo],
        board: VirtualBoard | RemoteBoard | None = None,
        *,
        rests: bool = False,
    ) -> None:
        """Couple a simulation to servos, in the robot's joint order, and to a board with an IMU.

        ``rests`` says whether a robot that lies still without torque is simulated no further until
        torque comes on: its sensors go on.
        """
        self.simulation = simulation
        self.time = 0.0
        """Bus time [s]; unlike the simulation's clock it is never reset."""
        self.motors = tuple(servos)
        """Its servos, in the order of the joints."""
        self._board = board
        robot = simulation.robot
        joints = robot.joints
        self._units = ServoUnits(robot)
        self._sign = np.array([float(joint.servo.sign) for joint in joints])
        self._models = [joint.servo.model for joint in joints]
        self._lock = threading.RLock()
        self._rests, self._still_for = rests, 0.0
        self._steps_since_sensing = 0
        self._driven: tuple[Array, Drive] | None = None
        self._last_commands: list[MotorCommand] = []
        self.on_sense: list[Callable[[], None]] = []
        """Called whenever the sensors were updated, as after each run of physics steps."""
        self._sense()

    @property
    def is_at_rest(self) -> bool:
        """Return whether the robot lies still without torque, and is simulated no further."""
        return self._rests and self._still_for >= REST_TIME

    def rearrange(self, change: Callable[[Simulation], None]) -> None:
        """Move a robot by other means than its servos; the bus time is kept."""
        with self._lock:
            change(self.simulation)
            self._steps_since_sensing = 0
            self._still_for = 0.0
            self._sense()

    def pass_period(self) -> None:
        """Advance by one control period."""
        self.advance(self.time + self.simulation.period)

    def advance(self, to: float) -> None:
        """Advance by whole physics steps, at most up to a bus time [s]."""
        step = self.simulation.model.opt.timestep
        with self._lock:
            left = int((to - self.time) / step + 1e-6)
            while left > 0:
                left -= self._run_steps(left, step)

    def heat(self, servo_id: int, temperature: float) -> None:
        """Set the temperature of a servo [°C]; raises ValueError if there is no such servo."""
        with self._lock:
            joint = [servo.id for servo in self.motors].index(servo_id)
            self.simulation.temperature[joint] = temperature
            self._sense()

    def sag(self, voltage: float) -> None:
        """Set the supply voltage [V]."""
        with self._lock:
            self.simulation.sag(voltage)
            self._sense()

    def _run_steps(self, left: int, step: float) -> int:
        """Run as many steps as need no new motor commands or sensor update; return how many."""
        simulation = self.simulation
        commands = [servo.motor_command() for servo in self.motors]
        moving = any(servo.has_profile for servo in self.motors)
        until_sensing = simulation.steps_per_period - self._steps_since_sensing
        steps = 1 if moving else min(left, until_sensing)
        # A servo keeps its command until something changes.
        is_same = all(map(is_, commands, self._last_commands))
        if moving or self._driven is None or not is_same:
            self._driven, self._last_commands = self._convert(commands), commands
        simulation.drive(*self._driven)
        self._note_rest(commands, steps * step)
        if not self.is_at_rest:
            simulation.step(steps)
        self.time += steps * step
        self._steps_since_sensing += steps
        if self._steps_since_sensing == simulation.steps_per_period:
            simulation.update_sensors(simulation.period)
            self._steps_since_sensing = 0
        for servo in self.motors:
            servo.advance(self.time)
        if self._board is not None:
            self._board.advance(self.time)
        self._sense()
        return steps

    def _note_rest(self, commands: list[MotorCommand], duration: float) -> None:
        """Count for how long [s] the robot has been limp and still."""
        if not self._rests:
            return
        speeds = self.simulation.data.qvel
        if any(command.torque_on for command in commands) or abs(speeds).max() > REST_SPEED:
            self._still_for = 0.0
        else:
            self._still_for += duration

    def _convert(self, commands: list[MotorCommand]) -> tuple[Array, Drive]:
        """Return the joint targets [rad], (n,), and the gains and limits of the position loops."""
        robot = self.simulation.robot
        on = np.array([d.torque_on for d in commands])
        target = self._units.to_actuator(np.array([d.target_ticks for d in commands]))
        gain = np.array([d.p_gain for d in commands]) / robot.p_gain
        by_current = np.array([d.by_current for d in commands])
        current = np.array([d.current_limit for d in commands])
        torque = np.where(by_current, current * robot.torque_per_ampere, robot.max_torque)
        damping = [m.damping_gain(d.d_gain) for m, d in zip(self._models, commands, strict=True)]
        return robot.transmission.to_joint(target), Drive(
            torque=np.where(on, np.minimum(torque, robot.max_torque), 0.0),
            pwm=np.array([d.pwm_limit for d in commands]),
            gain_scale=gain,
            by_current=by_current,
            follows_supply=~by_current,
            damping=robot.transmission.gain_at_actuator(np.array(damping)),
        )

    def _sense(self) -> None:
        simulation = self.simulation
        ticks = self._units.to_fractional_ticks(simulation.joint_pos)
        velocity = self._sign * simulation.robot.transmission.to_servo(simulation.joint_vel)
        current = self._sign * simulation.joint_current
        share = self._sign * simulation.pwm_share
        columns = (ticks, velocity, current, share, simulation.temperature)
        for servo, row in zip(self.motors, np.column_stack(columns).tolist(), strict=True):
            position, speed, amperes, pwm, degrees = row
            servo.sense(Measured(position, speed, amperes, pwm, simulation.voltage, degrees))
        if self._board is not None:
            self._board.sense_voltage(simulation.voltage)
            self._board.sense_body(simulation.imu.gyro, simulation.imu.accelerometer)
        for callback in self.on_sense:
            callback()
