"""Simulation of a robot in MuJoCo: its servos, its sensors, and time."""

from __future__ import annotations

import copy
import math
from collections.abc import Callable
from typing import Protocol, runtime_checkable

import mujoco
import numpy as np

from drivers.errors import NoImuError, SetupError
from drivers.twin.device_models import TwinImu, Windings
from drivers.twin.ground_truth import GroundTruth
from robots import Posture, Robot
from robots.gear_friction import GearFriction
from robots.ground import GROUND_FRICTION, add_ground
from robots.kinematics import place
from robots.quaternion import Array
from robots.robot import LONGEST_TIMESTEP
from robots.torque_limit import Drive

# MuJoCo's dry friction is soft: loaded joints without torque creep at up to 0.03 rad/s. Once they
# have been that slow for a while, its noslip solver holds them, as the friction of gears does.
REST_SPEED, REST_TIME, NOSLIP_ITERATIONS = 0.05, 1.0, 5  # rad/s and m/s; s
# kg, kg·m², N·s/m and N·m·s: neither gravity nor a servo moves what is held, and it does not creep.
HELD_INERTIA = HELD_DAMPING = 1e8


@runtime_checkable
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
    """Simulates a robot: `drive` sets the servos' targets, `step` advances time.

    It depends on no bus and no controller: the twin and the virtual bus are two interfaces to it.
    """

    def __init__(self, world: CompiledWorld | Robot, *, voltage: float | None = None) -> None:
        """Build a robot in its standing posture, torque off.

        Args:
            world: World to simulate, in a copy of its model; a robot alone is put on a plane.
            voltage: Supply [V]; ``None`` for the robot's nominal one.
        """
        if isinstance(world, Robot):
            robot, self.model = world, build_flat_world(world)
        else:
            robot, self.model = world.robot, copy.copy(world.model)
        self.robot, self.period = robot, robot.control_period
        self.data = mujoco.MjData(self.model)
        self.steps_per_period = _count_steps(self.period, self.model.opt.timestep)
        self._layout = robot.layout(self.model)
        self._actuators = _find_actuators(robot, self.model)
        if voltage is not None and not 0.0 < voltage < math.inf:
            raise ValueError(f"voltage is {voltage:g} V, expected a finite number above 0 V")
        self._supply = robot.supply_voltage if voltage is None else voltage
        self._supply_varies = robot.supply_resistance > 0.0
        self._windings = Windings(robot)
        self._imu: TwinImu | None = None
        if robot.imu_site is not None:
            self._imu = TwinImu(self.model, robot.imu_site)
        self.truth = GroundTruth(robot, self.model, self.data)
        self._grip: Grip | None = None
        self._friction = GearFriction(robot, self.model)
        self.on_sensor_update: list[Callable[[], None]] = []
        """Called after each `update_sensors`."""
        self.on_step: list[Callable[[], None]] = []
        """Called after each step of physics."""
        self.place(robot.standing)

    @property
    def imu(self) -> TwinImu:
        """Return its IMU; raises `NoImuError` if the robot has none."""
        if self._imu is None:
            raise NoImuError(self.robot.name)
        return self._imu

    @property
    def time(self) -> float:
        """Return the simulation's clock [s]."""
        return self.data.time

    @property
    def joint_pos(self) -> Array:
        """Return the joint angles, not yet quantized [rad], (n,)."""
        return self.data.qpos[self._layout.qpos]

    @property
    def joint_vel(self) -> Array:
        """Return the joint speeds [rad/s], (n,)."""
        return self.data.qvel[self._layout.dof]

    @property
    def joint_current(self) -> Array:
        """Return the motor currents [A], (n,)."""
        return self._current

    @property
    def has_torque(self) -> bool:
        """Return whether any servo drives its motor."""
        return self._drive is not None and bool(self._drive.torque.any())

    @property
    def temperature(self) -> Array:
        """Return the servos' temperatures [°C], (n,); it may be written to."""
        return self._windings.temperature

    def sag(self, voltage: float) -> None:
        """Set the supply [V]."""
        self._supply = self.voltage = voltage
        self._supply_varies = True

    def place(self, posture: Posture) -> None:
        """Place the robot at rest, cool, torque off, and start its clock at 0."""
        data = self.data
        self.let_go()
        mujoco.mj_resetData(self.model, data)
        data.qpos[:] = place(self.robot, self.model, posture)
        self._windings.cool()
        self._current = np.zeros(self.robot.n)
        self.pwm_share = np.zeros(self.robot.n)
        """Share of the supply that drives each motor, -1 to 1, (n,)."""
        self.torque_vel = np.zeros(self.robot.n)
        """Actuator speeds at which the present torques were made [rad/s], (n,)."""
        self.voltage = self._supply
        """Supply at the servos [V]."""
        self._drive: Drive | None = None
        if not self._friction.is_constant:
            self._load_gears()
        self.drive(posture.joint_pos, Drive.released(self.robot.n))
        mujoco.mj_step1(self.model, data)
        if self._imu is not None:
            self._imu.start(data)

    def hold(self, posture: Posture) -> None:
        """Place the robot as `place` does, held by a person: torso, and joints without torque."""
        self.place(posture)
        self._grip = Grip(self.robot, self.model)
        self._grip.hold(self.data, np.zeros(self.robot.n))

    def let_go(self) -> None:
        """Let a robot go that is held."""
        if self._grip is not None:
            self._grip.let_go()
        self._grip = None

    def turn(self, joint: int, by: float) -> None:
        """Turn a joint, by its number, by an angle [rad], as a person does who holds the robot."""
        robot, place = self.robot, self._layout.qpos[joint]
        name, target = robot.joint_names[joint], float(self.data.qpos[place]) + by
        lower, upper = robot.lower[joint], robot.upper[joint]
        if self._grip is None:
            raise ValueError(f"{name} cannot be turned: the robot is not held")
        if self._drive is not None and self._drive.torque[joint] > 0.0:
            raise ValueError(f"{name} cannot be turned: it has torque")
        if not lower <= target <= upper:
            degrees = np.degrees([target, lower, upper])
            raise ValueError(
                f"{name} would be at {degrees[0]:+.1f}°, expected {degrees[1]:+.1f}° to "
                f"{degrees[2]:+.1f}°"
            )
        self.data.qpos[place] = target
        mujoco.mj_step1(self.model, self.data)

    def drive(self, target: Array, drive: Drive) -> None:
        """Set the joint targets [rad], (n,), and the gains and limits of the servos from now on."""
        self._apply(self.robot.transmission.to_actuator(target), drive)

    def _apply(self, actuator_target: Array, drive: Drive) -> None:
        last, self._drive = self._drive, drive
        self.data.ctrl[self._actuators] = actuator_target
        if last is None or self._supply_varies or not drive.equals(last):
            # A force range of [0, 0] is torque off: friction and rotor inertia stay.
            limit = drive.limits(self.robot, self.voltage)
            self.model.actuator_forcerange[self._actuators, 0] = -limit
            self.model.actuator_forcerange[self._actuators, 1] = limit
            gains = drive.gains(self.robot, self.voltage)
            self.model.actuator_gainprm[self._actuators] = gains
        if last is None or not np.array_equal(last.torque, drive.torque):
            self._rest_time = 0.0
            self.model.opt.noslip_iterations = 0
            self._forget_targets()
            if self._grip is not None:
                self._grip.hold(self.data, drive.torque)

    def _forget_targets(self) -> None:
        """Fill the delay buffers with the present targets: none from before torque acts later."""
        for servo in self._actuators if self.model.nhistory else ():
            samples = np.full(self.model.actuator_history[servo, 0], self.data.ctrl[servo])
            mujoco.mj_initCtrlHistory(self.model, self.data, servo, None, samples)

    def release(self) -> None:
        """Switch off the torque of every servo."""
        self._apply(self.data.ctrl[self._actuators], Drive.released(self.robot.n))

    def step(self, steps: int) -> None:
        """Advance by some steps of physics."""
        for k in range(steps):
            if k == steps - 1:
                self.torque_vel = self.robot.transmission.to_actuator(self.joint_vel)
            # Together they are mj_step, but leave positions and contacts up to date.
            mujoco.mj_step2(self.model, self.data)
            mujoco.mj_step1(self.model, self.data)
            if not self._friction.is_constant:
                self._load_gears()
            for callback in self.on_step:
                callback()

    def _load_gears(self) -> None:
        """Set the friction of gears by the present torques of their motors."""
        gears, model = self._friction, self.model
        friction = gears.compute(self.data.actuator_force[self._actuators], self.joint_vel)
        model.dof_frictionloss[gears.dofs] = friction[gears.in_joints]
        model.tendon_frictionloss[gears.tendons] = friction[gears.in_tendons]

    def update_sensors(self, duration: float) -> None:
        """Update currents, heat, supply and IMU, ``duration`` seconds after the last update."""
        torque = self.data.actuator_force[self._actuators]
        self._current = self._windings.compute_current(torque)
        self._windings.heat(self._current, duration)
        assert self._drive is not None  # it is set whenever the robot is placed
        share = self._windings.compute_voltage(torque, self.torque_vel) / self.voltage
        self.pwm_share = np.where(self._drive.torque > 0.0, np.clip(share, -1.0, 1.0), 0.0)
        if self.robot.supply_resistance:
            self.voltage = float(self.robot.sag(self._supply, torque, self.torque_vel))
        if self._imu is not None:
            self._imu.advance(self.data, duration)
        self._hold_at_rest(duration)
        for callback in self.on_sensor_update:
            callback()

    def _hold_at_rest(self, duration: float) -> None:
        """Let friction hold a robot that has come to rest without torque."""
        is_slow = not self.has_torque and float(np.abs(self.data.qvel).max()) < REST_SPEED
        self._rest_time = self._rest_time + duration if is_slow else 0.0
        is_held, rests = self.model.opt.noslip_iterations > 0, self._rest_time >= REST_TIME
        self.model.opt.noslip_iterations = NOSLIP_ITERATIONS if rests else 0
        if rests and not is_held:
            mujoco.mj_projectConstraint(self.model, self.data)  # for the noslip solver's matrix


class Grip:
    """Holds the torso of a robot and each of its joints whose servo has no torque."""

    def __init__(self, robot: Robot, model: mujoco.MjModel) -> None:
        """Grip a robot in its compiled world; the model's inertia and damping are changed."""
        self._model, self._joint_dofs = model, robot.layout(model).dof
        torso = model.body(robot.torso).id
        self._own = model.dof_treeid == model.body_treeid[torso]
        self._armature, self._damping = model.dof_armature.copy(), model.dof_damping.copy()

    def hold(self, data: mujoco.MjData, torque: Array) -> None:
        """Hold all but the joints with torque [N·m], (n,), and bring what is held to rest."""
        held = self._own.copy()
        held[self._joint_dofs] = torque <= 0.0
        self._model.dof_armature[:] = np.where(held, HELD_INERTIA, self._armature)
        self._model.dof_damping[:] = np.where(held, HELD_DAMPING, self._damping)
        data.qvel[held] = 0.0
        mujoco.mj_step1(self._model, data)  # which takes the inertia up

    def let_go(self) -> None:
        """Let everything go; the model is as before."""
        self._model.dof_armature[:] = self._armature
        self._model.dof_damping[:] = self._damping


def build_flat_world(robot: Robot) -> mujoco.MjModel:
    """Compile a robot on a horizontal plane at z = 0."""
    spec = robot.spec()
    add_ground(spec, GROUND_FRICTION)
    return spec.compile()


def _count_steps(period: float, timestep: float) -> int:
    steps = round(period / timestep)
    if steps < 1 or abs(steps * timestep - period) > 1e-9:
        raise SetupError(
            f"period {period:g} s is not a multiple of the physics step {timestep:g} s"
        )
    if timestep > LONGEST_TIMESTEP + 1e-12:
        raise SetupError(f"physics step is {timestep:g} s, expected at most {LONGEST_TIMESTEP:g} s")
    return steps


def _find_actuators(robot: Robot, model: mujoco.MjModel) -> np.ndarray:
    kind, names = mujoco.mjtObj.mjOBJ_ACTUATOR, robot.joint_names
    ids = np.array([mujoco.mj_name2id(model, kind, name) for name in names])
    if np.any(ids < 0):
        missing = ", ".join(name for name, i in zip(names, ids, strict=True) if i < 0)
        raise SetupError(f"the model has no servo for: {missing}")
    return ids
