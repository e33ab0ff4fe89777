"""The vectorized simulation of training: delays, sensor errors and privileged state."""

from __future__ import annotations

from dataclasses import fields

import numpy as np

from humanoid_getup.experiments.judging.standing import StanceMeter, is_upright
from humanoid_getup.policy.action import between
from humanoid_getup.policy.observation import Sensed
from humanoid_getup.simulation.domain_parameters import DomainParameters
from humanoid_getup.simulation.physics_engine import MUJOCO, PhysicsEngine
from humanoid_getup.simulation.vectorized_simulation import Ids, VecSim
from humanoid_getup.simulation.world import World, count_substeps
from humanoid_getup.style.curves import SavedState, compute_features
from humanoid_getup.style.features import measure_height_map
from robots import quaternion
from robots.quaternion import Array
from sim2real.environment.env_options import ObservationNoise
from sim2real.environment.rewards import PrivilegedState
from sim2real.environment.training_world import SensorAddresses

BACKLASH_TORQUE = 0.3  # N·m that keep a gear at the end of its backlash


class TrainingSim(VecSim):
    """Steps N robots by policy steps and measures what a policy and its critic observe."""

    def __init__(
        self,
        world: World,
        n: int,
        *,
        cycles: int,
        pwm_limit: float = 1.0,
        threads: int = 0,
        noise: ObservationNoise | None = None,
        physics: PhysicsEngine = MUJOCO,
    ) -> None:
        """Build N robots with nominal parameters, as :class:`VecSim` does.

        The world is one of :func:`build_training_world`; a policy step has ``cycles`` control
        periods.
        """
        super().__init__(world, n, pwm_limit=pwm_limit, threads=threads, physics=physics)
        self.cycles, self.noise = cycles, noise or ObservationNoise()
        self.step_time = self.robot.control_period * cycles
        """Duration of a policy step [s]."""
        substeps = count_substeps(self.model, self.step_time)
        # Targets change every control period, as on the robot; every physics step if a control
        # period is not a multiple of it.
        self._changes = substeps if substeps % cycles else cycles
        self._hold = substeps // self._changes
        self._soles = [self.model.site(site).id for site in self.robot.sole_sites]
        self._neck = self.model.site(self.robot.neck_site).id
        self._addresses = SensorAddresses(world)
        self._meter = StanceMeter(self.robot, self.model, world.scene.support)
        if self._delays.exist:
            self._fields |= {
                name: self.batch.expand(name) for name in ("actuator_delay", "sensor_delay")
            }
        self.bind("xfrc_applied", "history", "site_xpos", "site_xmat", "sensordata")
        self._backlash = np.zeros((n, self.robot.n))  # encoder minus link angle by it [rad]
        self._torque = np.zeros((n, self.robot.n))  # of the servos after the last step [N·m]
        self.set_parameters(self.everyone, self.parameters)

    def set_parameters(self, ids: Ids, parameters: DomainParameters) -> None:
        """Set the domain parameters of some robots, in rising order of ``ids``."""
        super().set_parameters(ids, parameters)
        if self._delays.exist:
            self._fields["actuator_delay"][ids] = parameters.action_delay[:, None]
            self._fields["sensor_delay"][ids] = np.where(
                self._addresses.is_delayed, parameters.sensor_delay[:, None], 0.0
            )

    def place(self, ids: Ids, qpos: Array, qvel: Array | None = None) -> None:
        """Place some robots and fill their delay buffers; see :meth:`VecSim.place`."""
        super().place(ids, qpos, qvel)
        self._backlash[ids] = 0.0
        self._torque[ids] = self.torque[ids]

    def follow(
        self, target: Array, following: Array, record: tuple[str, ...] = ()
    ) -> dict[str, Array]:
        """Simulate a policy step in which targets [rad], (N, n), move at constant speed.

        The MjData fields ``record`` are returned as they are at the end of every control period,
        (N, cycles, ...); the physics step must then divide it.
        """
        return self.advance(self.make_targets(target, following), self._hold, record)

    def make_targets(self, target: Array, following: Array, reach: Array | None = None) -> Array:
        """Interpolate the targets of a step from the joint angles that servos measure, (N, T, n).

        T is the number of control periods, where the physics step divides them. With a reach
        [rad], (n,), targets are held, as `between` does it.
        """
        p, change = self.parameters, np.arange(self._changes)[:, None]
        offset = p.joint_offset
        if p.backlash.any():
            # The servo's torque pushes each gear to one end: the encoder leads the link.
            share = np.clip(self._torque / BACKLASH_TORQUE, -1.0, 1.0)
            self._backlash = 0.5 * p.backlash[:, None] * share
            offset = offset + self._backlash
        moving = between(target[:, None], following[:, None], change, self._changes, reach)
        return moving - offset[:, None]

    def advance(
        self, targets: Array, hold: int, record: tuple[str, ...] = (), ids: Ids | None = None
    ) -> dict[str, Array]:
        """Send joint targets; see :meth:`VecSim.advance`."""
        recorded = super().advance(targets, hold, record, ids)
        self._torque = self.torque
        return recorded

    def set_assistive_force(self, ids: Ids, share: Array) -> None:
        """Pull some robots up by a fraction of their weight, (len(ids),)."""
        mass = (self.model.body_mass * self.parameters.mass[ids]).sum(axis=1)
        weight = mass * -self.model.opt.gravity[2]
        self.read("xfrc_applied")[ids, self._layout.torso, 2] = share * weight

    def push(self, ids: Ids, velocity: Array) -> None:
        """Change the torso's velocity by a push [m/s], (len(ids), 3)."""
        root = self._layout.root_dof
        self.read("qvel")[ids, root : root + 3] += velocity

    def sense(self, rng: np.random.Generator | None = None) -> Sensed:
        """Read the sensors with the errors of the domain parameters, and noise from ``rng``."""
        p, at, data = self.parameters, self._addresses, self.read("sensordata")
        angle = np.linalg.norm(p.imu_tilt, axis=1)
        axis = p.imu_tilt / np.maximum(angle, 1e-12)[:, None]
        mounted = quaternion.multiply(at.imu_in_torso, quaternion.from_axis_angle(axis, angle))
        gravity = quaternion.rotate(mounted, quaternion.gravity_in_body(data[:, at.orientation]))
        gyro = quaternion.rotate(mounted, data[:, at.gyro] + p.gyro_bias)
        joint_pos = data[:, at.joint_pos] + p.joint_offset + self._backlash
        joint_vel = data[:, at.joint_vel]
        if rng is not None:
            noise = self.noise
            gravity = gravity + rng.normal(0.0, noise.gravity, gravity.shape)
            gyro = gyro + rng.normal(0.0, noise.gyro, gyro.shape)
            joint_pos = joint_pos + rng.normal(0.0, noise.joint_pos, joint_pos.shape)
            joint_vel = joint_vel + rng.normal(0.0, noise.joint_vel, joint_vel.shape)
        gravity /= np.linalg.norm(gravity, axis=-1, keepdims=True)
        return Sensed(gravity=gravity, gyro=gyro, joint_pos=joint_pos, joint_vel=joint_vel)

    def measure_privileged_state(self) -> PrivilegedState:
        """Measure the quantities that the robot's sensors cannot."""
        layout, sites, sensors = self._layout, self.read("site_xpos"), self.read("sensordata")
        qpos, qvel = self.read("qpos"), self.read("qvel")
        size = self.robot.standing_neck_height
        soles = sites[:, self._soles]  # (N, soles, 3)
        sole_height = soles[..., 2].mean(axis=1)
        from_neck = soles[..., :2].mean(axis=1) - sites[:, self._neck, :2]
        root = qpos[:, layout.root_qpos + 3 : layout.root_qpos + 7]
        head_velocity = sensors[:, self._addresses.head_velocity]
        contact = self.world.find_non_foot_contact(sensors)
        stance = self._meter.measure(qpos, sites, self.read("site_xmat"), contact)
        root_vel = qvel[:, layout.root_dof : layout.root_dof + 6]
        return PrivilegedState(
            height=stance.neck_height / size,
            stretch=(stance.neck_height - sole_height) / size,
            sole_height=sole_height / size,
            sole_heights=soles[..., 2] / size,
            sole_distance=np.linalg.norm(from_neck, axis=-1) / size,
            upright=-quaternion.gravity_in_body(root)[:, 2],
            standing=is_upright(stance, self.robot),
            non_foot_contact=contact,
            root_vel=root_vel,
            joint_speed=qvel[:, layout.dof] / self.robot.max_velocity,
            torque=self.torque / self.robot.max_torque,
            fall_speed=np.maximum(-root_vel[:, 2], 0.0) / size,
            head_contact=sensors[:, self._addresses.head_contact].sum(axis=1) > 0,
            head_fall=np.maximum(-head_velocity[:, 2:].sum(axis=1), 0.0) / size,
        )

    def measure_features(self) -> Array:
        """Measure the style features, which the robot's sensors cannot, (N, 3)."""
        neck = self.read("site_xpos")[:, self._neck]
        orientation = self.read("qpos")[:, self._layout.root_orientation]
        return compute_features(self.robot, neck, orientation, self.world.scene.ground)

    def measure_height_map(self) -> Array:
        """Measure the ground around the robots, (N, 25)."""
        qpos, layout = self.read("qpos"), self._layout
        position, orientation = qpos[:, layout.root_position], qpos[:, layout.root_orientation]
        return measure_height_map(self.robot, self.world.scene.ground, position, orientation)

    def save_state(self) -> SavedState:
        """Return the complete state, for :meth:`restore_state`."""
        parameters = {f.name: getattr(self.parameters, f.name) for f in fields(self.parameters)}
        return {
            "state": self.batch.state.copy(),
            "parameters": {name: values.copy() for name, values in parameters.items()},
            "backlash": self._backlash.copy(),
            "torque": self._torque.copy(),
        }

    def restore_state(self, state: SavedState) -> None:
        """Restore a state of :meth:`save_state`."""
        self.set_parameters(self.everyone, DomainParameters(**state["parameters"]))
        self.batch.state[:] = state["state"]
        self._backlash = state["backlash"].copy()
        self._torque = state["torque"].copy()

    def _compute_sensors(self, ids: Ids) -> None:
        """Compute sensors without delay, with whose values the delay buffers are filled."""
        if not self._delays.exist:
            super()._compute_sensors(ids)
            return
        delay = self._fields["sensor_delay"]
        kept = delay[ids]
        delay[ids] = 0.0
        super()._compute_sensors(ids)
        delay[ids] = kept
