"""Rehearsals: many copies of a robot in simulation, each playing its own targets."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import mujoco
import numpy as np
from mujoco.batch import Batch
from numpy.typing import NDArray

from humanoid_getup.simulation.world import World, count_substeps, find_foreign
from robots import quaternion
from robots.quaternion import Array

Bools = NDArray[np.bool_]

RECORDED = ("qpos", "site_xpos", "sensordata", "actuator_force")
CHUNK = 50  # cycles that are rolled out in one call


@dataclass(frozen=True, kw_only=True)
class Conditions:
    """What differs between rehearsals besides the start: shape (N,) each."""

    friction: Array
    """Sliding friction of every contact."""
    voltage: Array
    """Supply [V]."""
    torque_limit: Array
    """Cap on every servo [N·m]."""
    pwm_limited: bool = False
    """The caps are PWM limits, as servos in position mode have them, for all alike."""

    @staticmethod
    def nominal(world: World, n: int, *, torque_limit: float | None = None) -> Conditions:
        """Make ``n`` times the robot's nominal supply and the scene's own friction."""
        robot = world.robot
        limit = float(robot.max_torque.max()) if torque_limit is None else torque_limit
        return Conditions(
            friction=np.full(n, world.scene.friction),
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


@dataclass(frozen=True, kw_only=True)
class Observation:
    """What a steering function sees of the rehearsals at one cycle (first axis N)."""

    step: int
    com: Array
    """Center of mass of each body's subtree [m], (N, nbody, 3)."""
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
    """Steps ``n`` copies of a world side by side on a thread pool."""

    def __init__(self, world: World, n: int, *, threads: int = 0) -> None:
        self.world, self.n = world, n
        self.batch = Batch(world.model, n, threads)
        model, robot = world.model, world.robot
        self._substeps = count_substeps(model, robot.control_period)
        self._limbs = [int(model.sensor(f"limb_{b}").adr[0]) for b in world.limbs]
        self._joint_ids = [model.joint(name).id for name in robot.joint_names]
        batch = self.batch
        self._gains = batch.expand("actuator_gainprm")
        self._range = batch.expand("actuator_forcerange")
        self._friction = batch.expand("geom_friction")
        self._fields = {name: batch.bind(name) for name in (*RECORDED, "qvel", "ctrl")}

    def play(
        self,
        starts: Array,
        targets: Array,
        conditions: Conditions,
        *,
        steering: Steering | None = None,
    ) -> Trace:
        """Play targets from the start states, at rest, and record every cycle.

        Args:
            starts: MuJoCo positions, shape (N, nq).
            targets: Joint targets [rad], shape (N, T, n), one a control period.
            conditions: Friction, supply and torque limit of each.
            steering: Adds feedback to the targets; the result is what is recorded.
        """
        n, length, _ = targets.shape
        self._prepare(starts, conditions)
        record = {name: np.zeros((n, length, *self._fields[name].shape[1:])) for name in RECORDED}
        if steering is None:
            self._roll(targets, record)
            return self._read(record, targets)
        sent = np.zeros_like(targets)
        self.batch.forward()
        for k in range(length):
            sent[:, k] = steering(self._observe(k), targets[:, k])
            self._fields["ctrl"][:] = sent[:, k]
            self.batch.step(nstep=self._substeps)
            for name in RECORDED:
                record[name][:, k] = self._fields[name]
        return self._read(record, sent)

    def _prepare(self, starts: Array, conditions: Conditions) -> None:
        robot = self.world.robot
        self.batch.reset(stage=mujoco.mjtStage.mjSTAGE_NONE.value)
        self._fields["qpos"][:] = starts
        self._fields["qvel"][:] = 0.0
        limit = np.minimum(conditions.torque_limit[:, None], robot.max_torque)
        share = robot.pwm_limit(limit) if conditions.pwm_limited else 1.0
        self._gains[:] = robot.drive_gains(conditions.voltage, pwm_limit=share)
        self._range[..., 0], self._range[..., 1] = -limit, limit
        self._friction[:, :, 0] = conditions.friction[:, None]

    def _roll(self, targets: Array, record: dict[str, Array]) -> None:
        """Play targets that need no feedback, many cycles a call."""
        for first in range(0, targets.shape[1], CHUNK):
            some = slice(first, first + CHUNK)
            control = np.repeat(targets[:, some], self._substeps, axis=1)
            rolled = self.batch.rollout(control.shape[1], control, record=RECORDED)
            for name in RECORDED:
                record[name][:, some] = rolled[name][:, self._substeps - 1 :: self._substeps]

    def _observe(self, k: int) -> Observation:
        touch = self._fields["sensordata"]
        return Observation(
            step=k,
            com=self.batch.bind("subtree_com"),
            axis=self.batch.bind("xaxis")[:, self._joint_ids],
            anchor=self.batch.bind("xanchor")[:, self._joint_ids],
            limb_touch=touch[:, self._limbs] > 0,
            limb_point=np.stack([touch[:, a + 1 : a + 4] for a in self._limbs], axis=1),
        )

    def _read(self, record: dict[str, Array], sent: Array) -> Trace:
        robot, model = self.world.robot, self.world.model
        touch, qpos = record["sensordata"], record["qpos"]
        root = robot.layout(model).root_qpos
        feet = [int(model.sensor(f"foot_{site}").adr[0]) for site in robot.sole_sites]
        whole, overlap = (int(model.sensor(name).adr[0]) for name in ("whole", "overlap"))
        return Trace(
            period=robot.control_period,
            qpos=qpos,
            neck_height=record["site_xpos"][:, :, model.site(robot.neck_site).id, 2],
            tilt=quaternion.tilt(qpos[..., root + 3 : root + 7]),
            foreign=find_foreign(touch, whole, feet),
            overlap=-touch[..., overlap],
            torque=record["actuator_force"],
            target=sent,
        )
