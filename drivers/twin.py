"""The digital twin: a backend whose robot is a MuJoCo simulation."""

from __future__ import annotations

import copy

import mujoco
import numpy as np

from drivers.backend import ClosesItself
from drivers.errors import CommandError, ModelError, NotConnectedError
from drivers.servo_sensors import (
    CURRENT_STEP,
    VELOCITY_STEP,
    VOLTAGE_STEP,
    Encoders,
    SensorNoise,
    Windings,
    quantise,
)
from drivers.state import Command, State
from drivers.truth import GroundHeight, Truth, flat_ground
from drivers.twin_imu import TwinImu
from robots import Posture, Robot
from robots.rotation import Array

LONGEST_STEP = 0.002  # s
GROUND_FRICTION = 0.8


class Twin(ClosesItself):
    """Simulate a robot that measures and obeys like the real one.

    Time passes in ``write``: each call holds the command for one period of physics, so the
    twin runs in lock-step with its controller, as fast as the machine can. ``read`` only
    looks. ``truth`` is for judges.
    """

    def __init__(
        self,
        robot: Robot,
        model: mujoco.MjModel | None = None,
        *,
        voltage: float | None = None,
        supply_resistance: float = 0.0,
        period: float | None = None,
        noise: SensorNoise | None = None,
        rng: np.random.Generator | None = None,
        ground: GroundHeight = flat_ground,
    ) -> None:
        """Build a twin with the robot in its standing posture, limp.

        Args:
            robot: Robot to simulate.
            model: Compiled world that holds ``robot.spec()``; the twin works on its own
                copy. ``None`` for the robot on a plane.
            voltage: Supply without load [V]; ``None`` for the robot's nominal one.
            supply_resistance: Resistance of battery and wires [ohm]; the supply sags by it.
            period: Control period [s]; ``None`` for the robot's own.
            noise: Sensor noise; ``None`` for resolution alone.
            rng: Source of the noise.
            ground: Height of the ground, for ``truth.neck_height``.
        """
        self._robot = robot
        self._period = robot.control_period if period is None else period
        self.model = copy.copy(model) if model else build_flat_world(robot)
        self.data = mujoco.MjData(self.model)
        self._steps = _count_steps(self._period, self.model.opt.timestep)
        self._layout = robot.layout(self.model)
        self._actuators = _find_actuators(robot, self.model)
        self._supply = robot.supply_voltage if voltage is None else voltage
        self._supply_resistance = supply_resistance
        self._noise = noise or SensorNoise()
        self._rng = rng or np.random.default_rng(0)
        self._encoders, self._windings = Encoders(robot), Windings(robot)
        self._imu = TwinImu(self.model, robot.imu_site, self._noise, self._rng)
        self.truth = Truth(robot, self.model, self.data, ground)
        self._connected = False
        self._voltage = self._supply
        self._set_gains(np.ones(robot.n))
        self.place(robot.standing)

    @property
    def robot(self) -> Robot:
        """Return the simulated robot."""
        return self._robot

    @property
    def period(self) -> float:
        """Return the control period [s]."""
        return self._period

    def place(self, posture: Posture) -> None:
        """Put the robot somewhere, at rest, cool and limp, and start its clock at 0."""
        data, layout = self.data, self._layout
        mujoco.mj_resetData(self.model, data)
        root = layout.root_qpos
        data.qpos[root : root + 3] = posture.position
        data.qpos[root + 3 : root + 7] = posture.orientation
        data.qpos[layout.qpos] = posture.joint_pos
        data.ctrl[self._actuators] = posture.joint_pos
        self._release()
        self._windings.cool()
        self._current = np.zeros(self._robot.n)
        self._voltage = self._supply
        mujoco.mj_step1(self.model, data)
        self._imu.start(data)

    def connect(self) -> None:
        """Be ready to read and write; the robot stays where it is."""
        self._connected = True

    def close(self) -> None:
        """Release every joint."""
        self._release()
        self._connected = False

    def read(self) -> State:
        """Measure the robot through its sensors."""
        self._check_connected()
        layout, noise = self._layout, self._noise
        return State(
            time=self.data.time,
            joint_pos=self._encoders.quantise(
                self._add_noise(self.data.qpos[layout.qpos], noise.joint_pos)
            ),
            joint_vel=quantise(
                self._add_noise(self.data.qvel[layout.dof], noise.joint_vel), VELOCITY_STEP
            ),
            joint_current=quantise(
                self._add_noise(self._current, noise.joint_current), CURRENT_STEP
            ),
            gyro=self._imu.gyro,
            orientation=self._imu.orientation,
            temperature=np.rint(self._windings.temperature),
            voltage=round(self._voltage / VOLTAGE_STEP) * VOLTAGE_STEP,
        )

    def write(self, command: Command) -> Command:
        """Hold a command for one period of physics; return it with the servos' limits on it."""
        self._check_connected()
        _check_command(command, self._robot.n)
        sent = Command(
            joint_pos=command.joint_pos,
            gain_scale=command.gain_scale,
            torque_limit=np.minimum(command.torque_limit, self._robot.max_torque),
        )
        self._apply(sent)
        for _ in range(self._steps):
            # Together they are mj_step, but leave positions and contacts up to date.
            mujoco.mj_step2(self.model, self.data)
            mujoco.mj_step1(self.model, self.data)
        self._feel()
        return sent

    def _apply(self, command: Command) -> None:
        self.data.ctrl[self._actuators] = command.joint_pos
        limit = self.model.actuator_forcerange[self._actuators, 1]
        if not np.array_equal(limit, command.torque_limit):
            self._set_torque_limit(command.torque_limit)
        if self._supply_resistance or not np.array_equal(self._gain_scale, command.gain_scale):
            self._set_gains(command.gain_scale)

    def _set_torque_limit(self, torque_limit: Array) -> None:
        self.model.actuator_forcerange[self._actuators, 0] = -torque_limit
        self.model.actuator_forcerange[self._actuators, 1] = torque_limit

    def _set_gains(self, gain_scale: Array) -> None:
        self._gain_scale = gain_scale.copy()
        gains = self._robot.drive_gains(self._voltage, gain_scale)
        self.model.actuator_gainprm[self._actuators] = gains

    def _release(self) -> None:
        # A force range of [0, 0] is torque off: friction and rotor inertia stay.
        self._set_torque_limit(np.zeros(self._robot.n))

    def _feel(self) -> None:
        """Bring what the sensors integrate to the end of the period."""
        torque = self.data.actuator_force[self._actuators]
        self._current = self._windings.compute_current(torque)
        self._windings.heat(self._current, self._period)
        self._imu.advance(self.data, self._period)
        if self._supply_resistance:
            velocity = self.data.qvel[self._layout.dof]
            power = self._windings.compute_power(self._current, torque, velocity)
            self._voltage = self._supply - self._supply_resistance * power / self._voltage

    def _add_noise(self, value: Array, deviation: float) -> Array:
        return value + self._rng.normal(0.0, deviation, len(value)) if deviation else value

    def _check_connected(self) -> None:
        if not self._connected:
            raise NotConnectedError(f"twin of {self._robot.name}")


def build_flat_world(robot: Robot, friction: float = GROUND_FRICTION) -> mujoco.MjModel:
    """Compile a robot on a horizontal plane at z = 0."""
    spec = robot.spec()
    ground = spec.worldbody.add_geom(name="ground", type=mujoco.mjtGeom.mjGEOM_PLANE)
    ground.size[2] = 1.0
    ground.friction[0] = friction
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


def _check_command(command: Command, n: int) -> None:
    fields = {
        "targets": command.joint_pos,
        "gain shares": command.gain_scale,
        "torque limits": command.torque_limit,
    }
    faults = [
        f"{name}: {values}, allowed {n} finite numbers"
        for name, values in fields.items()
        if np.shape(values) != (n,) or not np.isfinite(values).all()
    ]
    if not faults and (command.torque_limit < 0.0).any():
        faults = [f"torque limits: {command.torque_limit}, allowed 0 or more"]
    if faults:
        raise CommandError(faults)
