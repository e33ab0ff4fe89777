"""Rollouts: joint trajectories played in simulation, many at a time, nominal or randomized."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from humanoid_getup.simulation.clearance import Clearance
from humanoid_getup.simulation.domain_parameters import DomainParameters
from humanoid_getup.simulation.vectorized_simulation import VecSim
from humanoid_getup.simulation.world import World, count_substeps
from robots import TorqueLimit, quaternion
from robots.ground import GROUND_FRICTION
from robots.kinematics import lowest_point
from robots.quaternion import Array
from robots.robot import Layout

Bools = NDArray[np.bool_]

RECORDED = ("qpos", "site_xpos", "sensordata", "actuator_force")
CHUNK = 50  # control periods that are simulated in one call


ROOM_SHARES = (1.0, 0.5, 0.25, 0.1)  # of a disturbance, tried in this order
MOST_RAISED = 0.04  # m by which a disturbance may raise or lower a robot


@dataclass(frozen=True, kw_only=True)
class Trace:
    """Record of N rollouts, sampled at the end of every control period."""

    period: float
    """[s]"""
    qpos: Array
    """MuJoCo positions, shape (N, T, nq)."""
    site_pos: Array
    """Positions of all sites in the world [m], (N, T, nsite, 3)."""
    non_foot_contact: Bools
    """Whether anything but the feet touched the world, (N, T)."""
    overlap: Array
    """Greatest depth of self-penetration [m], (N, T)."""
    torque: Array
    """Servo torques [N·m], (N, T, n)."""
    target: Array
    """Targets that the servos were sent [rad], (N, T, n)."""
    diverged: Bools
    """Whether the physics diverged: a rollout says nothing from there on, (N,)."""


@dataclass(frozen=True, kw_only=True)
class Feedback:
    """Input of a feedback law: N rollouts at the start of a control period."""

    step: int
    joint_pos: Array
    """Joint angles [rad], (N, n)."""
    com: Array
    """Center of mass of each body's subtree [m], (N, nbody, 3)."""
    axis: Array
    """Joint axes in the world, (N, n, 3)."""
    anchor: Array
    """Joint anchors in the world [m], (N, n, 3)."""
    limb_touch: Bools
    """Whether a limb touches the world, (N, limbs)."""
    limb_point: Array
    """Point at which the net contact force of each limb acts [m], (N, limbs, 3)."""


FeedbackLaw = Callable[[Feedback], Array | None]
"""Maps feedback to the targets that are sent (N, n), or to ``None`` at the end."""


class Rollout:
    """Plays ``n`` joint trajectories side by side in copies of a world."""

    def __init__(self, world: World, n: int, *, threads: int = 0) -> None:
        self.world, self.sim = world, VecSim(world, n, threads=threads)
        self.sim.bind(*RECORDED, "subtree_com", "xaxis", "xanchor")
        model, robot = world.model, world.robot
        self._hold = count_substeps(model, robot.control_period)
        self._limbs = [int(self.world.model.sensor(f"limb_{b}").adr[0]) for b in world.limbs]
        self._layout = robot.layout(model)
        self._joint_ids = [model.joint(name).id for name in robot.joint_names]

    def play(self, starts: Array, targets: Array, parameters: DomainParameters) -> Trace:
        """Play targets [rad], (N, T, n), from MuJoCo positions (N, nq), at rest.

        Targets last a control period each.
        """
        self._place(starts, parameters)
        parts, diverged = [], np.zeros(self.sim.n, dtype=bool)
        for first in range(0, targets.shape[1], CHUNK):
            chunk = targets[:, first : first + CHUNK]
            parts.append(self.sim.advance(chunk, self._hold, RECORDED))
            diverged |= self.sim.diverged
        record = {name: np.concatenate([part[name] for part in parts], axis=1) for name in RECORDED}
        return self._read(record, targets, diverged)

    def track(self, starts: Array, law: FeedbackLaw, parameters: DomainParameters) -> Trace:
        """Play what a feedback law sends, from MuJoCo positions (N, nq), at rest, until it ends."""
        self._place(starts, parameters)
        records: dict[str, list[Array]] = {name: [] for name in RECORDED}
        sent: list[Array] = []
        diverged = np.zeros(self.sim.n, dtype=bool)
        while (target := law(self._observe(len(sent)))) is not None:
            self.sim.hold(target, self._hold)
            sent.append(target)
            diverged |= self.sim.diverged
            for name, record in records.items():
                record.append(self.sim.read(name).copy())
        record = {name: np.stack(samples, axis=1) for name, samples in records.items()}
        return self._read(record, np.stack(sent, 1), diverged)

    def _place(self, starts: Array, parameters: DomainParameters) -> None:
        self.sim.set_parameters(self.sim.everyone, parameters)
        self.sim.place(self.sim.everyone, starts)

    def _observe(self, step: int) -> Feedback:
        contact = self.sim.read("sensordata")
        return Feedback(
            step=step,
            joint_pos=self.sim.qpos[:, self._layout.qpos],
            com=self.sim.read("subtree_com"),
            axis=self.sim.read("xaxis")[:, self._joint_ids],
            anchor=self.sim.read("xanchor")[:, self._joint_ids],
            limb_touch=contact[:, self._limbs] > 0,
            limb_point=np.stack([contact[:, a + 1 : a + 4] for a in self._limbs], axis=1),
        )

    def _read(self, record: dict[str, Array], sent: Array, diverged: Bools) -> Trace:
        contact = record["sensordata"]
        return Trace(
            period=self.world.robot.control_period,
            qpos=record["qpos"],
            site_pos=record["site_xpos"],
            non_foot_contact=self.world.find_non_foot_contact(contact),
            overlap=-contact[..., int(self.world.model.sensor("overlap").adr[0])],
            torque=record["actuator_force"],
            target=sent,
            diverged=diverged,
        )


@dataclass(frozen=True, kw_only=True)
class RolloutRandomization:
    """Spread of the randomized rollouts about the nominal one."""

    joints: float = np.radians(3.0)
    """Standard deviation of the start angles [rad]."""
    root: float = np.radians(5.0)
    """Standard deviation of the root's rotation about a random axis [rad]."""
    friction: tuple[float, float] = (0.4, 1.2)
    """Range of the sliding friction, where the nominal one is that of a usual ground."""
    supply: tuple[float, float] = (11.0 / 12.0, 12.6 / 12.0)
    """Range, as a share of the robot's nominal supply."""


def randomize_rollouts(
    world: World,
    start: Array,
    n: int,
    randomization: RolloutRandomization,
    torque_limit: TorqueLimit,
    rng: np.random.Generator,
) -> tuple[Array, DomainParameters]:
    """Make starts, MuJoCo positions (n, nq), and parameters, of which the first are nominal.

    The nominal ``start`` has shape (nq,); the torque limit is that of every servo.
    """
    robot = world.robot
    layout = robot.layout(world.model)
    starts = np.tile(start, (n, 1))
    noise = rng.normal(scale=randomization.joints, size=(n, robot.n))
    axis = rng.normal(size=(n, 3))
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    turn = quaternion.from_axis_angle(axis, rng.normal(scale=randomization.root, size=n))
    friction = rng.uniform(*randomization.friction, size=n)
    friction *= world.scene.friction / GROUND_FRICTION
    supply = rng.uniform(*randomization.supply, size=n)
    noise[0], turn[0], friction[0], supply[0] = 0.0, quaternion.IDENTITY, world.scene.friction, 1.0
    starts[:, layout.qpos] = np.clip(starts[:, layout.qpos] + noise, robot.lower, robot.upper)
    root = starts[:, layout.root_orientation]  # a view
    root[:] = quaternion.multiply(turn, root)
    _rest_as(world, start, starts[1:])
    voltage = supply * robot.supply_voltage
    return starts, DomainParameters.nominal(
        world,
        n,
        friction=friction,
        voltage=voltage,
        torque_limit=torque_limit.value,
        limit_by=torque_limit.by,
    )


def _rest_as(world: World, start: Array, others: Array) -> None:
    """Put MuJoCo positions (N, nq) as high over what is under them as a start (nq,), in place.

    They are neither lifted off the ground nor pressed into it. Where there is no room for one
    under a table, for instance, it becomes more like the start, until there is.
    """
    layout = world.robot.layout(world.model)
    root = layout.root_qpos + 2
    if world.scene.is_flat:
        rest = lowest_point(world.model, start)
        others[:, root] += [rest - lowest_point(world.model, row) for row in others]
        return
    clearance = Clearance(world)
    under = float(world.scene.support(start[root - 2 : root + 1]))
    above = float(start[root] - clearance.rest_where(start)[root])
    for row in others:
        for share in ROOM_SHARES:
            nearer = _blend(layout, start, row, share)
            rested = clearance.rest(nearer, above, over=under)
            if abs(rested[root] - start[root]) < MOST_RAISED:
                row[:] = rested
                break
        else:
            row[:] = start


def _blend(layout: Layout, start: Array, other: Array, share: float) -> Array:
    """Go a share of the way from one lying robot to another, MuJoCo positions (nq,)."""
    blended = start + share * (other - start)
    orientation = layout.root_orientation
    blended[orientation] = quaternion.slerp(start[orientation], other[orientation], share)
    return blended
