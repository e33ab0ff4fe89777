"""The herd: many copies of a robot in simulation, sensed and moved a policy step at a time."""

from __future__ import annotations

import copy
from typing import Any

import mujoco
import numpy as np
from mujoco.batch import Batch
from numpy.typing import NDArray

from humanoid_getup.policy.action import between
from humanoid_getup.policy.observation import Sensed
from humanoid_getup.simulation.world import count_substeps, find_foreign
from robots import Robot, quaternion
from robots.quaternion import Array
from robots.servo import round_pwm
from sim2real.environment.conditions import Conditions, Noise
from sim2real.environment.delay_buffers import DelayBuffer, Ids
from sim2real.environment.privileged_state import PrivilegedState
from sim2real.environment.training_world import Addresses

FIRM = 0.3  # N·m that hold a gear at the end of its free play


class Herd:
    """Steps ``n`` robots side by side on a thread pool, each under its own conditions."""

    judged = ("qpos", "qvel", "site_xpos", "sensordata", "actuator_force")
    """What :meth:`advance` must record for :meth:`judge`."""

    def __init__(
        self,
        model: mujoco.MjModel,
        robot: Robot,
        n: int,
        *,
        cycles: int,
        pwm_limit: float = 1.0,
        threads: int = 0,
        noise: Noise | None = None,
    ) -> None:
        """Build a herd of a compiled world.

        Args:
            model: World made by :func:`sim2real.environment.training_world.build_world`.
            robot: Robot in it.
            n: How many.
            cycles: Control cycles a policy step.
            pwm_limit: Largest share of the supply that the motors get.
            threads: Threads that step physics; 0 for all that the machine has.
            noise: Noise of the sensors.
        """
        self.robot, self.model, self.n, self.cycles = robot, model, n, cycles
        self.noise, self._pwm_limit = noise or Noise(), pwm_limit
        self.batch = Batch(model, n, threads)
        self._substeps = count_substeps(model, self.step_time)
        # Targets move once a control cycle, as on the robot; where a coarse physics step does
        # not divide a cycle, once a physics step.
        self._moves = self._substeps if self._substeps % cycles else cycles
        self._move = np.repeat(np.arange(self._moves), self._substeps // self._moves)[:, None]
        self._layout = robot.layout(model)
        self.conditions = Conditions.nominal(robot, model.nbody, n)
        self._servos = np.array([model.actuator(name).id for name in robot.joint_names])
        dcmotor = mujoco.mjtGain.mjGAIN_DCMOTOR
        self._has_motors = bool(np.all(model.actuator_gaintype[self._servos] == dcmotor))
        self._neck = model.site(robot.neck_site).id
        self._soles = [model.site(site).id for site in robot.sole_sites]
        self._torso = model.body(robot.torso).id
        self._read = Addresses(model, robot)
        self._memory = DelayBuffer(model)
        names = (
            "qpos",
            "qvel",
            "ctrl",
            "xfrc_applied",
            "history",
            "site_xpos",
            "sensordata",
            "actuator_force",
        )
        self._data = {name: self.batch.bind(name) for name in names}
        expand = self.batch.expand
        self._fields = {
            name: expand(name)
            for name in (
                "body_mass",
                "body_inertia",
                "body_ipos",
                "geom_friction",
                "actuator_gainprm",
                "actuator_forcerange",
                "dof_armature",
                "dof_frictionloss",
                "actuator_delay",
                "sensor_delay",
            )
        }
        self.diverged = np.zeros(n, dtype=bool)
        """Whose physics went wrong in the last policy step: what they show means nothing, (N,)."""
        self._play = np.zeros((n, robot.n))  # where in its free play each gear is [rad]
        self._torque = np.zeros((n, robot.n))  # of the servos when last looked at [N·m]
        self.set_conditions(np.arange(n), self.conditions)

    @property
    def step_time(self) -> float:
        """Return how long a policy step is [s]."""
        return self.robot.control_period * self.cycles

    def set_conditions(self, ids: Ids, conditions: Conditions) -> None:
        """Give some robots other bodies, servos, sensors and ground."""
        self.conditions.put(ids, conditions)
        robot, model, c, fields = self.robot, self.model, conditions, self._fields
        fields["body_mass"][ids] = model.body_mass * c.mass
        fields["body_inertia"][ids] = model.body_inertia * c.mass[:, :, None]
        ipos = np.tile(model.body_ipos, (c.n, 1, 1))
        ipos[:, self._torso] += c.com_shift
        fields["body_ipos"][ids] = ipos
        friction = np.tile(model.geom_friction, (c.n, 1, 1))
        friction[:, :, 0] = c.friction[:, None]
        fields["geom_friction"][ids] = friction
        limit = np.minimum(c.torque_limit[:, None], robot.max_torque) * c.strength
        pwm = np.where(c.pwm_limited[:, None], robot.pwm_limit(limit), 1.0)
        pwm = np.minimum(pwm, round_pwm(self._pwm_limit))
        gains = robot.drive_gains(c.voltage, c.strength, pwm)
        gainprm = np.tile(model.actuator_gainprm, (c.n, 1, 1))
        force = np.tile(model.actuator_forcerange, (c.n, 1, 1))
        if self._has_motors:
            gainprm[:, self._servos] = gains
            force[:, self._servos, 0], force[:, self._servos, 1] = -limit, limit
        fields["actuator_gainprm"][ids] = gainprm
        fields["actuator_forcerange"][ids] = force
        fields["dof_armature"][ids] = model.dof_armature * c.armature[:, None]
        fields["dof_frictionloss"][ids] = model.dof_frictionloss * c.friction_loss[:, None]
        if self._memory.exists:
            fields["actuator_delay"][ids] = c.action_delay[:, None]
            fields["sensor_delay"][ids] = np.where(
                self._read.is_delayed, c.sensor_delay[:, None], 0.0
            )
        self.batch.set_const(ids)

    def place(self, ids: Ids, qpos: Array, qvel: Array | None = None) -> None:
        """Put some robots somewhere, with targets where their joints are.

        Args:
            ids: Which, in rising order.
            qpos: MuJoCo positions, (len(ids), nq).
            qvel: MuJoCo velocities, (len(ids), nv); ``None`` for rest.
        """
        self.batch.reset(ids, stage=mujoco.mjtStage.mjSTAGE_NONE.value)
        self._data["qpos"][ids] = qpos
        self._data["qvel"][ids] = 0.0 if qvel is None else qvel
        self._play[ids] = 0.0
        self._data["ctrl"][ids] = qpos[:, self._layout.qpos]
        if self._memory.exists:
            self._fill_memory(ids)
        else:
            self.batch.forward(ids)
        self._torque[ids] = self._read_torque()[ids]

    def advance(
        self, target: Array, following: Array, record: tuple[str, ...] = ()
    ) -> dict[str, Array]:
        """Let a policy step pass while targets go from one place to the next.

        Args:
            target: Targets at its begin [rad], (N, n).
            following: Targets at its end [rad], (N, n).
            record: MjData fields to return; the physics step must divide a control cycle.

        Returns:
            Each field at the end of every control cycle, (N, cycles, ...).
        """
        c = self.conditions
        offset = c.joint_offset
        if c.backlash.any():
            offset = offset + self._take_up_play()
        steps = self._substeps
        moving = between(target[:, None], following[:, None], self._move, self._moves)
        control = moving - offset[:, None]
        # Where MuJoCo warns of what is no number, it begins anew and counts from one again.
        warnings = self.batch.warning[..., 1]
        warnings[:] = 0
        rolled = self.batch.rollout(steps, control, record=record)
        self.diverged = np.any(warnings > 0, axis=1)
        self._torque = self._read_torque()
        every = steps // self.cycles
        return {name: rolled[name][:, every - 1 :: every] for name in record}

    def judge(self, recorded: dict[str, Array]) -> dict[str, NDArray[Any]]:
        """Pick what judges need out of a recorded policy step, (N, cycles, ...)."""
        touch, read = recorded["sensordata"], self._read
        return {
            "qpos": recorded["qpos"],
            "neck_height": recorded["site_xpos"][..., self._neck, 2],
            "foreign": find_foreign(touch, read.whole, read.feet),
            "torque": recorded["actuator_force"][..., self._servos],
            "joint_vel": recorded["qvel"][..., self._layout.dof],
            "head_touch": touch[..., read.head_touch].sum(axis=-1) > 0,
            "head_speed": np.linalg.norm(touch[..., read.head_velocity], axis=-1),
        }

    def lift(self, ids: Ids, share: Array) -> None:
        """Let some robots hang from above by a share of their weight, (len(ids),)."""
        weight = self._fields["body_mass"][ids].sum(axis=1) * -self.model.opt.gravity[2]
        self._data["xfrc_applied"][ids, self._torso, 2] = share * weight

    def push(self, ids: Ids, velocity: Array) -> None:
        """Change the torso's velocity by a push [m/s], (len(ids), 3)."""
        root = self._layout.root_dof
        self._data["qvel"][ids, root : root + 3] += velocity

    def sense(self, rng: np.random.Generator | None = None) -> Sensed:
        """Read the sensors, as old, crooked and noisy as the conditions make them.

        Args:
            rng: Source of the noise; ``None`` for none.
        """
        c, read, data = self.conditions, self._read, self._data["sensordata"]
        angle = np.linalg.norm(c.imu_tilt, axis=1)
        axis = c.imu_tilt / np.maximum(angle, 1e-12)[:, None]
        mounted = quaternion.multiply(read.imu_in_torso, quaternion.from_axis_angle(axis, angle))
        gravity = quaternion.rotate(mounted, quaternion.gravity_in_body(data[:, read.orientation]))
        gyro = quaternion.rotate(mounted, data[:, read.gyro] + c.gyro_bias)
        joint_pos = data[:, read.joint_pos] + c.joint_offset + self._play
        joint_vel = data[:, read.joint_vel]
        if rng is not None:
            noise = self.noise
            gravity = gravity + rng.normal(0.0, noise.gravity, gravity.shape)
            gyro = gyro + rng.normal(0.0, noise.gyro, gyro.shape)
            joint_pos = joint_pos + rng.normal(0.0, noise.joint_pos, joint_pos.shape)
            joint_vel = joint_vel + rng.normal(0.0, noise.joint_vel, joint_vel.shape)
        gravity /= np.linalg.norm(gravity, axis=-1, keepdims=True)
        return Sensed(gravity=gravity, gyro=gyro, joint_pos=joint_pos, joint_vel=joint_vel)

    def look(self) -> PrivilegedState:
        """See what only a simulation knows."""
        data, read, layout = self._data, self._read, self._layout
        site, touch = data["site_xpos"], data["sensordata"]
        soles = site[:, self._soles]  # (N, soles, 3)
        neck = site[:, self._neck]
        root = data["qpos"][:, layout.root_qpos + 3 : layout.root_qpos + 7]
        return PrivilegedState(
            neck_height=neck[:, 2],
            sole_height=soles[..., 2],
            sole_distance=np.linalg.norm(soles[..., :2].mean(axis=1) - neck[:, :2], axis=-1),
            upright=-quaternion.gravity_in_body(root)[:, 2],
            foreign=find_foreign(touch, read.whole, read.feet),
            head_fall=np.maximum(-touch[:, read.head_velocity][:, 2:].sum(axis=1), 0.0),
            root_vel=data["qvel"][:, layout.root_dof : layout.root_dof + 6],
            joint_vel=data["qvel"][:, layout.dof],
            torque=self._read_torque(),
        )

    def save_state(self) -> dict[str, Any]:
        """Return everything that the next steps depend on."""
        return {
            "state": self.batch.state.copy(),
            "fields": {name: values.copy() for name, values in self._fields.items()},
            "conditions": copy.deepcopy(self.conditions),
            "play": self._play.copy(),
            "torque": self._torque.copy(),
        }

    def restore_state(self, state: dict[str, Any]) -> None:
        """Go on from where :meth:`save_state` was called."""
        for name, values in state["fields"].items():
            self._fields[name][:] = values
        self.batch.set_const()
        self.batch.state[:] = state["state"]
        self.conditions = copy.deepcopy(state["conditions"])
        self._play = state["play"].copy()
        self._torque = state["torque"].copy()

    @property
    def qpos(self) -> Array:
        """Return a copy of the MuJoCo positions, (N, nq)."""
        return self._data["qpos"].copy()

    @property
    def qvel(self) -> Array:
        """Return a copy of the MuJoCo velocities, (N, nv)."""
        return self._data["qvel"].copy()

    def _take_up_play(self) -> Array:
        """Put each gear where its servo's torque pushes it: the encoder leads the link, (N, n)."""
        half = 0.5 * self.conditions.backlash[:, None]
        self._play = half * np.clip(self._torque / FIRM, -1.0, 1.0)
        return self._play

    def _read_torque(self) -> Array:
        """Read a copy of the servos' torques [N·m], (N, n)."""
        return self._data["actuator_force"][:, self._servos]

    def _fill_memory(self, ids: Ids) -> None:
        """Let the past of some robots be their present."""
        # The past is still blank, so sensors are read without their delay.
        delay = self._fields["sensor_delay"]
        kept = delay[ids]
        delay[ids] = 0.0
        self.batch.forward(ids)
        delay[ids] = kept
        self._memory.fill(self._data["history"], ids, self._data["ctrl"], self._data["sensordata"])
