"""A robot's body in MuJoCo: its servos' drive, its sensors, the time that passes."""

from __future__ import annotations

import copy
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import mujoco
import numpy as np

from drivers.errors import ModelError
from drivers.twin.ground_truth import GroundTruth
from drivers.twin.imu_model import TwinImu
from drivers.twin.servo_model import SensorNoise, Windings
from robots import Posture, Robot
from robots.ground import GROUND_FRICTION, add_ground
from robots.quaternion import Array

LONGEST_STEP = 0.002  # s
# MuJoCo's dry friction is soft: loaded joints without torque creep at up to 0.03 rad/s. Once they
# have been that slow for a while, its noslip solver holds them, as the friction of gears does.
REST_SPEED, REST_TIME, NOSLIP_ITERATIONS = 0.05, 1.0, 5  # rad/s and m/s; s


@dataclass(frozen=True, kw_only=True, eq=False)
class Drives:
    """What every servo does: position mode, or no torque."""

    target: Array
    """Angles that the position loops aim at [rad], shape (n,)."""
    gain_scale: Array
    """Share of each servo's position gain, shape (n,)."""
    torque_limit: Array
    """Largest torque [N·m], shape (n,); 0 is torque off."""
    pwm_limit: Array
    """Largest share of the supply that drives the motor, shape (n,)."""

    def has_gains_of(self, other: Drives) -> bool:
        """Tell whether gains and PWM limits are another's."""
        same_gains = np.array_equal(self.gain_scale, other.gain_scale)
        return same_gains and np.array_equal(self.pwm_limit, other.pwm_limit)


class CompiledWorld(Protocol):
    """A robot compiled into its surroundings."""

    @property
    def robot(self) -> Robot:
        """Return the robot."""
        ...

    @property
    def model(self) -> mujoco.MjModel:
        """Return the model, which holds ``robot.spec()``."""
        ...


class Simulation:
    """Simulate a robot; whoever drives it sets `Drives` and lets time pass.

    It knows no bus and no controller: the twin and the virtual bus are two ways to it.
    """

    def __init__(
        self,
        world: CompiledWorld | Robot,
        *,
        voltage: float | None = None,
        supply_resistance: float = 0.0,
        period: float | None = None,
        noise: SensorNoise | None = None,
        rng: np.random.Generator | None = None,
    ) -> None:
        """Build a robot in its standing posture, limp.

        Args:
            world: World to simulate, in a copy of its model; a robot alone is put on a plane.
            voltage: Supply without load [V]; ``None`` for the robot's nominal one.
            supply_resistance: Resistance of battery and wires [ohm]; the supply sags by it.
            period: Time between two looks of the sensors [s]; ``None`` for the robot's own.
            noise: Sensor noise; ``None`` for resolution alone.
            rng: Source of the noise.
        """
        if isinstance(world, Robot):
            robot, self.model = world, build_flat_world(world)
        else:
            robot, self.model = world.robot, copy.copy(world.model)
        self.robot = robot
        self.period = robot.control_period if period is None else period
        self.data = mujoco.MjData(self.model)
        self.steps_per_period = _count_steps(self.period, self.model.opt.timestep)
        self._layout = robot.layout(self.model)
        self._actuators = _find_actuators(robot, self.model)
        self._supply = robot.supply_voltage if voltage is None else voltage
        self._supply_resistance = supply_resistance
        self._supply_varies = bool(supply_resistance)
        self._noise = noise or SensorNoise()
        self._rng = rng or np.random.default_rng(0)
        self._windings = Windings(robot)
        self.imu = TwinImu(self.model, robot.imu_site, self._noise, self._rng)
        self.truth = GroundTruth(robot, self.model, self.data)
        self.on_look: list[Callable[[], None]] = []
        """Called after each look of the sensors, by whoever lets time pass."""
        self.place(robot.standing)

    @property
    def time(self) -> float:
        """Return the simulation's clock [s]."""
        return self.data.time

    @property
    def joint_pos(self) -> Array:
        """Return the joint angles [rad], noise on them but not yet in ticks, (n,)."""
        return self._add_noise(self.data.qpos[self._layout.qpos], self._noise.joint_pos)

    @property
    def joint_vel(self) -> Array:
        """Return the joint speeds [rad/s], noise on them, (n,)."""
        return self._add_noise(self.data.qvel[self._layout.dof], self._noise.joint_vel)

    @property
    def joint_current(self) -> Array:
        """Return the motor currents [A], noise on them, (n,)."""
        return self._add_noise(self._current, self._noise.joint_current)

    @property
    def has_torque(self) -> bool:
        """Tell whether any servo drives its motor."""
        return self._drives is not None and bool(self._drives.torque_limit.any())

    @property
    def temperature(self) -> Array:
        """Return the servos' temperatures [°C], (n,); it may be written to."""
        return self._windings.temperature

    @property
    def voltage(self) -> float:
        """Return the supply at the servos [V]."""
        return self._voltage

    @property
    def supply(self) -> float:
        """Return the supply without load [V]; setting it is a battery that sags."""
        return self._supply

    @supply.setter
    def supply(self, voltage: float) -> None:
        self._supply = self._voltage = voltage
        self._supply_varies = True

    def place(self, posture: Posture) -> None:
        """Put the robot somewhere, at rest, cool and limp, and start its clock at 0."""
        data, layout = self.data, self._layout
        mujoco.mj_resetData(self.model, data)
        root = layout.root_qpos
        data.qpos[root : root + 3] = posture.position
        data.qpos[root + 3 : root + 7] = posture.orientation
        data.qpos[layout.qpos] = posture.joint_pos
        self._windings.cool()
        self._current = np.zeros(self.robot.n)
        self._voltage = self._supply
        self._drives: Drives | None = None
        self.drive(limp_drives(posture.joint_pos))
        mujoco.mj_step1(self.model, data)
        self.imu.start(data)

    def drive(self, drives: Drives) -> None:
        """Set what the servos do from now on."""
        last, self._drives = self._drives, drives
        self.data.ctrl[self._actuators] = drives.target
        if last is None or not np.array_equal(last.torque_limit, drives.torque_limit):
            # A force range of [0, 0] is torque off: friction and rotor inertia stay.
            self.model.actuator_forcerange[self._actuators, 0] = -drives.torque_limit
            self.model.actuator_forcerange[self._actuators, 1] = drives.torque_limit
            self._rest_time = 0.0
            self.model.opt.noslip_iterations = 0
        if last is None or self._supply_varies or not drives.has_gains_of(last):
            gains = self.robot.drive_gains(self._voltage, drives.gain_scale, drives.pwm_limit)
            self.model.actuator_gainprm[self._actuators] = gains

    def release(self) -> None:
        """Take the torque from every servo."""
        self.drive(limp_drives(self.data.ctrl[self._actuators]))

    def step(self, steps: int) -> None:
        """Let some steps of physics pass."""
        for _ in range(steps):
            # Together they are mj_step, but leave positions and contacts up to date.
            mujoco.mj_step2(self.model, self.data)
            mujoco.mj_step1(self.model, self.data)

    def feel(self, duration: float) -> None:
        """Bring what the sensors integrate up to date.

        Args:
            duration: Time since the last look [s].
        """
        torque = self.data.actuator_force[self._actuators]
        self._current = self._windings.compute_current(torque)
        self._windings.heat(self._current, duration)
        self.imu.advance(self.data, duration)
        self._hold_at_rest(duration)
        if self._supply_resistance:
            velocity = self.data.qvel[self._layout.dof]
            power = self._windings.compute_power(self._current, torque, velocity)
            self._voltage = self._supply - self._supply_resistance * power / self._voltage
        for look in self.on_look:
            look()

    def _hold_at_rest(self, duration: float) -> None:
        """Let friction hold a robot that has come to rest without torque."""
        is_slow = not self.has_torque and float(np.abs(self.data.qvel).max()) < REST_SPEED
        self._rest_time = self._rest_time + duration if is_slow else 0.0
        is_held, rests = self.model.opt.noslip_iterations > 0, self._rest_time >= REST_TIME
        self.model.opt.noslip_iterations = NOSLIP_ITERATIONS if rests else 0
        if rests and not is_held:
            mujoco.mj_projectConstraint(self.model, self.data)  # for the noslip solver's matrix

    def _add_noise(self, value: Array, deviation: float) -> Array:
        return value + self._rng.normal(0.0, deviation, len(value)) if deviation else value


def limp_drives(joint_pos: Array) -> Drives:
    """Build the drives of servos without torque."""
    n = len(joint_pos)
    ones = np.ones(n)
    return Drives(target=joint_pos, gain_scale=ones, torque_limit=np.zeros(n), pwm_limit=ones)


def build_flat_world(robot: Robot, friction: float = GROUND_FRICTION) -> mujoco.MjModel:
    """Compile a robot on a horizontal plane at z = 0."""
    spec = robot.spec()
    add_ground(spec, friction)
    return spec.compile()


def _count_steps(period: float, timestep: float) -> int:
    steps = round(period / timestep)
    if steps < 1 or abs(steps * timestep - period) > 1e-9:
        raise ModelError(
            f"period {period:g} s is not a multiple of the physics step {timestep:g} s"
        )
    if timestep > LONGEST_STEP + 1e-12:
        raise ModelError(f"physics step is {timestep:g} s, allowed {LONGEST_STEP:g} s or finer")
    return steps


def _find_actuators(robot: Robot, model: mujoco.MjModel) -> np.ndarray:
    missing = [
        name
        for name in robot.joint_names
        if mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_ACTUATOR, name) < 0
    ]
    if missing:
        raise ModelError(f"the model has no servo for: {', '.join(missing)}")
    return np.array([model.actuator(name).id for name in robot.joint_names])
