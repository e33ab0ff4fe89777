"""Vectorized simulation: N worlds stepped at once, on a thread pool or on a GPU."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np
from numpy.typing import NDArray

from humanoid_getup.simulation.delay_buffers import DelayBuffers
from humanoid_getup.simulation.domain_parameters import DomainParameters
from humanoid_getup.simulation.physics_engine import MUJOCO, PhysicsEngine
from humanoid_getup.simulation.world import World
from robots.gear_friction import GearFriction
from robots.quaternion import Array
from robots.torque_limit import limit_servos

Ids = NDArray[np.int_]

BODY_PARAMETERS = ("mass", "com_shift", "armature", "friction_loss")
BODY_FIELDS = ("body_mass", "body_inertia", "body_ipos", "dof_armature", "dof_frictionloss")
TENDON_FIELDS = ("tendon_armature", "tendon_frictionloss")  # of coupled servos
DRIVE_FIELDS = ("geom_friction", "actuator_gainprm", "actuator_forcerange")


class VecSim:
    """Steps N copies of a world, each under its own domain parameters.

    Every copy moves bit for bit as it would alone in a loop of ``mj_step``, unless the physics is
    that of mujoco-warp.
    """

    def __init__(
        self,
        world: World,
        n: int,
        *,
        pwm_limit: float = 1.0,
        threads: int = 0,
        physics: PhysicsEngine = MUJOCO,
    ) -> None:
        """Build ``n`` copies under nominal domain parameters.

        The PWM limit is the largest share of the supply at the motors; 0 threads are one per
        processor.
        """
        self.world, self.n = world, n
        self.robot, self.model = world.robot, world.model
        self.batch = physics.make_batch(world.model, n, threads)
        self.parameters = DomainParameters.nominal(world, n)
        self.diverged = np.zeros(n, dtype=bool)
        """Whether a world's physics diverged in the last advance: its state is invalid, (N,)."""
        self.everyone = np.arange(n)
        self._layout = world.robot.layout(world.model)
        self._pwm_limit = pwm_limit
        self._servos = np.array([self.model.actuator(name).id for name in self.robot.joint_names])
        dcmotor = mujoco.mjtGain.mjGAIN_DCMOTOR
        self._has_motors = bool(np.all(self.model.actuator_gaintype[self._servos] == dcmotor))
        self._data: dict[str, Array] = {}
        self.bind("qpos", "qvel", "ctrl", "actuator_force")
        self._delays = DelayBuffers(self.model)
        if self._delays.exist:
            self.bind("history", "sensordata")
        self._fields = {name: self.batch.expand(name) for name in DRIVE_FIELDS}
        # Friction of each geom as a share of the ground's: obstacles may have their own.
        own = self.model.geom_friction[:, 0] / world.scene.surface.friction
        self._friction_share = np.where(world.is_world_geom, own, 1.0)
        self.gears = GearFriction(self.robot, self.model)
        """Friction of the gears, of which all worlds have the same figures."""
        if not self.gears.is_constant:
            for name in ("dof_frictionloss", "tendon_frictionloss")[: 1 + bool(self.model.ntendon)]:
                self._fields[name] = self.batch.expand(name)
        self._set_drives(self.everyone, self.parameters)

    def read(self, name: str) -> Array:
        """Return a live view of a bound MjData field, (N, ...).

        State fields may be written; outputs are those of the last call that computed them.
        """
        return self._data[name]

    def bind(self, *names: str) -> None:
        """Make MjData fields readable, starting with the next call that computes them."""
        self._data |= {name: self.batch.bind(name) for name in names}

    def bind_state(self) -> dict[str, Array]:
        """Return live views of all that worlds of like parameters go on from, (N, ...) each."""
        names = ["time", "qpos", "qvel", "qacc_warmstart"]
        names += ["history"] if self._delays.exist else []
        self.bind(*names)
        driven = ["actuator_gainprm", "actuator_forcerange"] if self.robot.supply_resistance else []
        if not self.gears.is_constant:
            driven += [name for name in self._fields if name.endswith("_frictionloss")]
        return {n: self._data[n] for n in names} | {n: self._fields[n] for n in driven}

    @property
    def qpos(self) -> Array:
        """Return a copy of the MuJoCo positions, (N, nq)."""
        return self.read("qpos").copy()

    @property
    def qvel(self) -> Array:
        """Return a copy of the MuJoCo velocities, (N, nv)."""
        return self.read("qvel").copy()

    @property
    def torque(self) -> Array:
        """Return a copy of the actuators' torques [N·m], (N, n)."""
        return self.read("actuator_force")[:, self._servos]

    def set_parameters(self, ids: Ids, parameters: DomainParameters) -> None:
        """Set the domain parameters of some worlds, in rising order of ``ids``."""
        changed = any(
            not np.array_equal(getattr(self.parameters, name)[ids], getattr(parameters, name))
            for name in BODY_PARAMETERS
        )
        self.parameters.put(ids, parameters)
        self._set_drives(ids, parameters)
        if changed:
            self._set_bodies(ids, parameters)

    def place(self, ids: Ids, qpos: Array, qvel: Array | None = None) -> None:
        """Place the robots ``ids``, in rising order, with targets equal to their joint angles.

        MuJoCo positions are (len(ids), nq), velocities (len(ids), nv), at rest without them.
        """
        self.batch.reset(ids, stage=mujoco.mjtStage.mjSTAGE_NONE.value)
        self.read("qpos")[ids] = qpos
        self.read("qvel")[ids] = 0.0 if qvel is None else qvel
        self.read("ctrl")[ids] = self.robot.transmission.to_actuator(qpos[:, self._layout.qpos])
        self._compute_sensors(ids)
        if self._delays.exist:
            self._delays.fill(self.read("history"), ids, self.read("ctrl"), self.read("sensordata"))
        self._sag_supply(ids)
        self._load_gears(ids)

    def advance(
        self, targets: Array, hold: int, record: tuple[str, ...] = (), ids: Ids | None = None
    ) -> dict[str, Array]:
        """Send joint targets [rad], (N, T, n), each for ``hold`` physics steps.

        The N worlds are ``ids``, or all. The MjData fields ``record`` are returned as they are
        at the end of every target, (N, T, ...). The friction of gears under load follows after
        every target, the supply behind a resistance after every control period.
        """
        rows = self.everyone if ids is None else ids
        count, each = targets.shape[1], 1
        target_time = hold * self.model.opt.timestep
        period = max(round(self.robot.control_period / target_time), 1)  # in targets
        if self.gears.is_constant:
            each = period if self.robot.supply_resistance else count
        diverged, rolled = np.zeros(self.n, dtype=bool), list[dict[str, Array]]()
        for k in range(0, count, each):
            rolled.append(self._roll_out(targets[:, k : k + each], hold, record, ids))
            diverged |= self.diverged
            self._load_gears(rows)
            if (k + each) % period == 0 or k + each >= count:
                self._sag_supply(rows)
        self.diverged = diverged
        return {name: np.concatenate([one[name] for one in rolled], axis=1) for name in record}

    def _roll_out(
        self, targets: Array, hold: int, record: tuple[str, ...], ids: Ids | None
    ) -> dict[str, Array]:
        # After a warning of NaN or Inf, MuJoCo resets a world and counts from one again.
        warnings = self.batch.warning[..., 1]
        warnings[:] = 0
        control = np.repeat(self.robot.transmission.to_actuator(targets), hold, axis=1)
        rolled = self.batch.rollout(control.shape[1], control, record=record, ids=ids)
        self.diverged = np.any(warnings > 0, axis=1)
        return {name: rolled[name][:, hold - 1 :: hold] for name in record}

    def hold(self, target: Array, steps: int, ids: Ids | None = None) -> None:
        """Send one joint target [rad] to each of the worlds ``ids``, or all, for physics steps."""
        warnings = self.batch.warning[..., 1]
        warnings[:] = 0
        rows = self.everyone if ids is None else ids
        self.read("ctrl")[rows] = self.robot.transmission.to_actuator(target)
        self.batch.step(rows, nstep=steps)
        self.diverged = np.any(warnings > 0, axis=1)
        self._sag_supply(rows)
        self._load_gears(rows)

    def _sag_supply(self, ids: Ids) -> None:
        """Set the supply behind a resistance by the present currents of the motors."""
        robot = self.robot
        if not robot.supply_resistance:
            return
        drawn, torque = self.parameters.take(ids), self.read("actuator_force")[ids][:, self._servos]
        speed = robot.transmission.to_actuator(self.read("qvel")[ids][:, self._layout.dof])
        self._set_drives(ids, replace(drawn, voltage=robot.sag(drawn.voltage, torque, speed)))

    def _load_gears(self, ids: Ids) -> None:
        """Set the friction of gears by the present torques and speeds of the motors."""
        gears = self.gears
        if gears.is_constant:
            return
        torque = self.read("actuator_force")[ids][:, self._servos]
        friction = gears.compute(torque, self.read("qvel")[ids][:, self._layout.dof])
        friction *= self.parameters.friction_loss[ids][:, None]
        self._fields["dof_frictionloss"][ids[:, None], gears.dofs] = friction[:, gears.in_joints]
        if len(gears.tendons):
            loss = self._fields["tendon_frictionloss"]
            loss[ids[:, None], gears.tendons] = friction[:, gears.in_tendons]

    def _compute_sensors(self, ids: Ids) -> None:
        """Update the outputs of robots that were just placed."""
        self.batch.forward(ids)

    def _set_drives(self, ids: Ids, parameters: DomainParameters) -> None:
        """Set contact friction, and gains and limits of the servos."""
        robot, model, p, fields = self.robot, self.model, parameters, self._fields
        fields["geom_friction"][ids, :, 0] = p.friction[:, None] * self._friction_share
        if not self._has_motors:
            return
        drive = limit_servos(
            robot,
            np.minimum(p.torque_limit[:, None], robot.max_torque) * p.strength,
            p.limit_by[:, None],
            gain_scale=p.strength,
            pwm_limit=self._pwm_limit,
        )
        weak = np.where(drive.follows_supply, np.minimum(p.strength, 1.0), 1.0)
        limit = drive.limits(robot, p.voltage) * weak
        gainprm = np.tile(model.actuator_gainprm, (p.n, 1, 1))
        gainprm[:, self._servos] = drive.gains(robot, p.voltage)
        fields["actuator_gainprm"][ids] = gainprm
        force = np.tile(model.actuator_forcerange, (p.n, 1, 1))
        force[:, self._servos, 0], force[:, self._servos, 1] = -limit, limit
        fields["actuator_forcerange"][ids] = force

    def _set_bodies(self, ids: Ids, parameters: DomainParameters) -> None:
        """Set masses and rotors, and the constants that MuJoCo derives from them."""
        model, p, fields = self.model, parameters, self._fields
        tendon_fields = TENDON_FIELDS if model.ntendon else ()
        for name in (*BODY_FIELDS, *tendon_fields):
            if name not in fields:
                fields[name] = self.batch.expand(name)
        fields["body_mass"][ids] = model.body_mass * p.mass
        fields["body_inertia"][ids] = model.body_inertia * p.mass[:, :, None]
        fields["body_ipos"][ids] = model.body_ipos
        fields["body_ipos"][ids, self._layout.torso] += p.com_shift
        fields["dof_armature"][ids] = model.dof_armature * p.armature[:, None]
        fields["dof_frictionloss"][ids] = model.dof_frictionloss * p.friction_loss[:, None]
        if tendon_fields:
            fields["tendon_armature"][ids] = model.tendon_armature * p.armature[:, None]
            friction = model.tendon_frictionloss * p.friction_loss[:, None]
            fields["tendon_frictionloss"][ids] = friction
        self.batch.set_const(ids)
