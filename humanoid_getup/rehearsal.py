"""Rehearsals: many copies of a robot in simulation, each playing its own targets."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import mujoco
import numpy as np
from mujoco.batch import Batch
from numpy.typing import NDArray

from humanoid_getup.stage import Stage
from robots import Robot, rotation
from robots.rotation import Array

Bools = NDArray[np.bool_]


@dataclass(frozen=True, kw_only=True)
class Conditions:
    """What differs between rehearsals besides the start: shape (N,) each."""

    friction: Array
    """Sliding friction of every contact."""
    voltage: Array
    """Supply [V]."""
    torque_limit: Array
    """Cap on every servo [N·m]."""

    @staticmethod
    def nominal(robot: Robot, n: int, *, torque_limit: float | None = None) -> Conditions:
        """Make ``n`` times the robot's nominal supply and the ground's own friction."""
        limit = float(robot.max_torque.max()) if torque_limit is None else torque_limit
        return Conditions(
            friction=np.full(n, 0.8),
            voltage=np.full(n, robot.supply_voltage),
            torque_limit=np.full(n, limit),
        )


@dataclass(frozen=True, kw_only=True)
class Trace:
    """What N rehearsals went through, sampled every control period, from the start on."""

    period: float
    """[s]"""
    qpos: Array
    """MuJoCo positions, shape (N, T, nq)."""
    neck_height: Array
    """Height of the neck site over the ground [m], (N, T)."""
    tilt: Array
    """Angle between torso and vertical [rad], (N, T)."""
    foreign: Bools
    """Whether anything but the feet touched the world, (N, T)."""
    overlap: Array
    """How deep the robot is in itself, at most [m], (N, T)."""
    torque: Array
    """Servo torques [N·m], (N, T, n)."""
    target: Array
    """What the servos were sent [rad], (N, T, n)."""


@dataclass
class Observation:
    """What a steering function sees of the rehearsals at one cycle (first axis N)."""

    step: int
    joint_pos: Array
    joint_vel: Array
    qpos: Array
    qvel: Array
    com: Array
    """Centre of mass of each body's subtree [m], (N, nbody, 3)."""
    axis: Array
    """Joint axes in the world, (N, n, 3)."""
    anchor: Array
    """Joint anchors in the world [m], (N, n, 3)."""
    limb_touch: Bools
    """Whether a limb touches the world, (N, limbs)."""
    limb_point: Array
    """Where it does [m], (N, limbs, 3)."""


Steering = Callable[[Observation, Array], Array]
"""Maps an observation and the planned targets (N, n) to the targets sent (N, n)."""


class Rehearsal:
    """Steps ``n`` copies of a stage side by side on a thread pool."""

    def __init__(self, stage: Stage, n: int, *, threads: int = 0) -> None:
        self.stage, self.n = stage, n
        self.batch = Batch(stage.model, n, threads)
        model, robot = stage.model, stage.robot
        self._layout = robot.layout(model)
        self._substeps = round(robot.control_period / model.opt.timestep)
        self._neck = model.site(robot.neck_site).id
        self._feet = [int(model.sensor(f"foot_{s}").adr[0]) for s in robot.sole_sites]
        self._whole = int(model.sensor("whole").adr[0])
        self._overlap = int(model.sensor("overlap").adr[0])
        self._limbs = [int(model.sensor(f"limb_{b}").adr[0]) for b in stage.limbs]
        self._joint_ids = [model.joint(name).id for name in robot.joint_names]
        b = self.batch
        self._gains, self._range = b.expand("actuator_gainprm"), b.expand("actuator_forcerange")
        self._friction = b.expand("geom_friction")
        self._bound = {
            name: b.bind(name)
            for name in ("qpos", "qvel", "ctrl", "site_xpos", "sensordata", "actuator_force")
        }

    def play(
        self,
        starts: Array,
        targets: Array,
        conditions: Conditions,
        *,
        steering: Steering | None = None,
        keep: Callable[[Array, Array, Bools], bool] | None = None,
    ) -> Trace:
        """Play targets from the start states, at rest, and record every cycle.

        Args:
            starts: MuJoCo positions, shape (N, nq).
            targets: Joint targets [rad], shape (N, T, n), one a control period.
            conditions: Friction, supply and torque limit of each.
            steering: Adds feedback to the targets; the result is what is recorded.
            keep: Called every 25 cycles with neck height, tilt and foreign so far;
                returns False to stop all early.
        """
        n, length, _ = targets.shape
        self._prepare(starts, conditions)
        model, bound = self.stage.model, self._bound
        out = _Recorder(n, length, model.nq, self.stage.robot.n)
        self.batch.forward()
        used = length
        for k in range(length):
            sent = targets[:, k]
            if steering is not None:
                sent = steering(self._observe(k), sent)
            bound["ctrl"][:] = sent
            self.batch.step(nstep=self._substeps)
            self._record(out, k, sent)
            if keep is not None and k % 25 == 24:
                done = slice(0, k + 1)
                if not keep(out.neck[:, done], out.tilt[:, done], out.foreign[:, done]):
                    used = k + 1
                    break
        return out.trace(self.stage.robot.control_period, used)

    def _prepare(self, starts: Array, conditions: Conditions) -> None:
        robot = self.stage.robot
        self.batch.reset(stage=mujoco.mjtStage.mjSTAGE_NONE.value)
        self._bound["qpos"][:] = starts
        self._bound["qvel"][:] = 0.0
        self._gains[:] = robot.drive_gains(conditions.voltage)
        limit = np.minimum(conditions.torque_limit[:, None], robot.max_torque)
        self._range[..., 0], self._range[..., 1] = -limit, limit
        self._friction[:, :, 0] = conditions.friction[:, None]

    def _record(self, out: _Recorder, k: int, sent: Array) -> None:
        bound, layout = self._bound, self._layout
        qpos, touch = bound["qpos"], bound["sensordata"]
        out.qpos[:, k] = qpos
        out.neck[:, k] = bound["site_xpos"][:, self._neck, 2]
        root = layout.root_qpos
        out.tilt[:, k] = rotation.tilt(qpos[:, root + 3 : root + 7])
        out.foreign[:, k] = touch[:, self._whole] > touch[:, self._feet].sum(axis=-1)
        out.overlap[:, k] = -touch[:, self._overlap]
        out.torque[:, k] = bound["actuator_force"]
        out.target[:, k] = sent

    def _observe(self, k: int) -> Observation:
        batch, layout = self.batch, self._layout
        qpos, qvel, touch = self._bound["qpos"], self._bound["qvel"], self._bound["sensordata"]
        points = np.stack([touch[:, a + 1 : a + 4] for a in self._limbs], axis=1)
        return Observation(
            step=k,
            joint_pos=qpos[:, layout.qpos],
            joint_vel=qvel[:, layout.dof],
            qpos=qpos,
            qvel=qvel,
            com=batch.bind("subtree_com"),
            axis=batch.bind("xaxis")[:, self._joint_ids],
            anchor=batch.bind("xanchor")[:, self._joint_ids],
            limb_touch=touch[:, self._limbs] > 0,
            limb_point=points,
        )


class _Recorder:
    def __init__(self, n: int, length: int, nq: int, joints: int) -> None:
        self.qpos = np.zeros((n, length, nq))
        self.neck = np.zeros((n, length))
        self.tilt = np.zeros((n, length))
        self.foreign = np.zeros((n, length), dtype=bool)
        self.overlap = np.zeros((n, length))
        self.torque = np.zeros((n, length, joints))
        self.target = np.zeros((n, length, joints))

    def trace(self, period: float, used: int) -> Trace:
        return Trace(
            period=period,
            qpos=self.qpos[:, :used],
            neck_height=self.neck[:, :used],
            tilt=self.tilt[:, :used],
            foreign=self.foreign[:, :used],
            overlap=self.overlap[:, :used],
            torque=self.torque[:, :used],
            target=self.target[:, :used],
        )
