"""The body on the virtual bus: servos' registers on one side, physics on the other."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence

import numpy as np

from drivers.dynamixel.control_table import OperatingMode
from drivers.orientation_filter import ACCELEROMETER_STEP, GYRO_STEP
from drivers.servo_units import ServoUnits
from drivers.twin.servo_model import VELOCITY_STEP
from drivers.twin.simulation import Drives, Simulation
from drivers.virtual_bus.devices.board import VirtualBoard
from drivers.virtual_bus.devices.motor_command import Drive
from drivers.virtual_bus.devices.servo import VirtualServo
from robots import Posture
from robots.quaternion import Array
from robots.servo import DEFAULT_P_GAIN, PWM_FULL_SCALE, RAD_PER_TICK

PLAIN_MODES = (OperatingMode.POSITION, OperatingMode.EXTENDED_POSITION)
CONTROL_RATE = 1000.0  # Hz, of a servo's integrators; not published


class ServoPhysics:
    """Lets time pass in a simulation whose joints are driven by servos' registers.

    Before each stretch of physics the servos tell what they do; after it they are told
    what they would measure. The servos' position loops are the simulation's own, so a robot
    behind the bus moves as its twin does, bit for bit. In the other modes a target is worked
    out in each physics step that makes the position loop do what the mode asks for. Of the
    position loop's gains, only P acts. Any thread may let time pass.
    """

    def __init__(
        self,
        simulation: Simulation,
        servos: Sequence[VirtualServo],
        board: VirtualBoard | None = None,
        imu_axes: tuple[int, int, int] = (1, 1, 1),
    ) -> None:
        """Couple a simulation to servos, in the robot's joint order, and a board with an IMU."""
        self.simulation = simulation
        self.time = 0.0
        """Bus time [s]; it never goes back, the simulation's clock does."""
        self._servos, self._board = list(servos), board
        self._imu_axes = np.array(imu_axes)
        robot = simulation.robot
        joints = robot.joints
        self._units = ServoUnits(robot)
        self._sign = np.array([float(joint.servo.sign) for joint in joints])
        self._zero = np.array([joint.servo.zero_ticks for joint in joints])
        models = [joint.servo.model for joint in joints]
        self._torque_per_ampere = np.array([m.stall_torque / m.stall_current for m in models])
        self._integral = np.zeros(robot.n)
        self._lock = threading.RLock()
        self._steps_since_look = 0
        self._drives: Drives | None = None
        self._last_drives: list[Drive] = []
        self.on_pass: list[Callable[[], None]] = []
        """Called after each stretch of time, by whoever lets it pass."""
        self._sense()

    @property
    def period(self) -> float:
        """Return the control period [s]."""
        return self.simulation.period

    def place(self, posture: Posture) -> None:
        """Put the robot somewhere, at rest, cool and limp; the bus time goes on."""
        with self._lock:
            self.simulation.place(posture)
            for servo in self._servos:
                servo.poke("torque_enable", 0)
            self._steps_since_look = 0
            self._sense()

    def pass_period(self) -> None:
        """Let one control period pass."""
        self.advance(self.time + self.period)

    def advance(self, to: float) -> None:
        """Let time pass in whole steps of physics, up to a bus time [s] at most."""
        step = self.simulation.model.opt.timestep
        with self._lock:
            left = int((to - self.time) / step + 1e-6)
            while left > 0:
                left -= self._stretch(left, step)

    def heat(self, servo_id: int, temperature: float) -> None:
        """Bring a servo to a temperature [°C]."""
        with self._lock:
            self.simulation.temperature[self._find(servo_id)] = temperature
            self._sense()

    def sag(self, voltage: float) -> None:
        """Set what the battery gives [V]."""
        with self._lock:
            self.simulation.supply = voltage
            self._sense()

    def _find(self, servo_id: int) -> int:
        return [servo.id for servo in self._servos].index(servo_id)

    def _stretch(self, left: int, step: float) -> int:
        """Pass as many steps as may be passed in one go; return how many."""
        body = self.simulation
        drives = [servo.drive() for servo in self._servos]
        plain = all(not d.torque_on or d.mode in PLAIN_MODES for d in drives)
        moving = not plain or any(servo.has_profile for servo in self._servos)
        until_look = body.steps_per_period - self._steps_since_look
        steps = 1 if moving else min(left, until_look)
        if moving or self._drives is None or not _are_the_same(drives, self._last_drives):
            self._drives, self._last_drives = self._convert(drives, plain, step), drives
        body.drive(self._drives)
        body.step(steps)
        self.time += steps * step
        self._steps_since_look += steps
        if self._steps_since_look == body.steps_per_period:
            body.feel(body.period)
            self._steps_since_look = 0
        for servo in self._servos:
            servo.advance(self.time)
        if self._board is not None:
            self._board.advance(self.time)
        self._sense()
        for look in self.on_pass:
            look()
        return steps

    def _convert(self, drives: list[Drive], plain: bool, step: float) -> Drives:
        robot = self.simulation.robot
        on = np.array([d.torque_on for d in drives])
        target = self._units.to_rad(np.array([d.target_ticks for d in drives]))
        gain = np.array([d.p_gain for d in drives]) / DEFAULT_P_GAIN
        pwm_limit = np.array([d.pwm_limit for d in drives])
        if not plain:
            for i, drive in enumerate(drives):
                if drive.torque_on and drive.mode not in PLAIN_MODES:
                    # The position loop is only the way to the motor here: at its usual gain.
                    gain[i] = 1.0
                    target[i] = self._aim(i, drive, step)
        return Drives(
            target=target,
            gain_scale=gain,
            torque_limit=np.where(on, robot.max_torque, 0.0),
            pwm_limit=pwm_limit,
        )

    def _aim(self, i: int, drive: Drive, step: float) -> float:
        """Find the target [rad] at which the position loop does what another mode asks for."""
        body, robot = self.simulation, self.simulation.robot
        position, velocity = body.joint_pos[i], body.joint_vel[i]
        stiffness = (
            robot.position_gain[i] * body.voltage / robot.joints[i].servo.model.nominal_voltage
        )
        back_emf = robot.torque_speed_slope[i] * velocity  # what the loop loses to speed [N·m]
        if drive.mode == OperatingMode.PWM:
            torque = drive.goal_pwm * self._sign[i] * robot.max_torque[i]
        elif drive.mode == OperatingMode.VELOCITY:
            torque = self._pursue_velocity(i, drive, velocity, step) * robot.max_torque[i]
        else:
            current = drive.goal_current * self._sign[i]
            if drive.mode == OperatingMode.CURRENT_BASED_POSITION:
                target = float(self._sign[i] * (drive.target_ticks - self._zero[i])) * RAD_PER_TICK
                current = drive.p_gain / DEFAULT_P_GAIN * robot.position_gain[i]
                current *= (target - position) / self._torque_per_ampere[i]
            limit = drive.current_limit
            torque = float(np.clip(current, -limit, limit)) * self._torque_per_ampere[i] + back_emf
        return position + torque / stiffness

    def _pursue_velocity(self, i: int, drive: Drive, velocity: float, step: float) -> float:
        """Compute the share of the supply that a velocity loop applies."""
        error = (drive.goal_velocity * self._sign[i] - velocity) / VELOCITY_STEP  # counts
        self._integral[i] += drive.velocity_i_gain / 65536 * error * step * CONTROL_RATE
        self._integral[i] = float(np.clip(self._integral[i], -PWM_FULL_SCALE, PWM_FULL_SCALE))
        counts = drive.velocity_p_gain / 128 * error + self._integral[i]
        return float(np.clip(counts / PWM_FULL_SCALE, -drive.pwm_limit, drive.pwm_limit))

    def _sense(self) -> None:
        """Tell servos and board what they measure."""
        body = self.simulation
        ticks = self._zero + self._sign * body.joint_pos / RAD_PER_TICK
        velocity = self._sign * body.joint_vel
        current = self._sign * body.joint_current
        temperature, voltage = body.temperature, body.voltage
        for i, servo in enumerate(self._servos):
            servo.sense(
                ticks=float(ticks[i]),
                velocity=float(velocity[i]),
                current=float(current[i]),
                pwm_share=0.0,
                voltage=voltage,
                temperature=float(temperature[i]),
            )
        if self._board is not None:
            self._board.sense_voltage(voltage)
            self._board.sense_imu(
                self._counts(body.imu.gyro, GYRO_STEP),
                self._counts(body.imu.accelerometer, ACCELEROMETER_STEP),
            )

    def _counts(self, value: Array, step: float) -> list[int]:
        return np.rint(self._imu_axes * value / step).astype(int).tolist()


def _are_the_same(drives: list[Drive], others: list[Drive]) -> bool:
    """Tell whether servos do what they did: a servo keeps its `Drive` until something changes."""
    return all(a is b for a, b in zip(drives, others, strict=True))
