"""Disturbances: how starts, friction and supply differ from the nominal."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from humanoid_getup.rehearsal import Conditions
from humanoid_getup.stage import Stage
from robots import rotation
from robots.rotation import Array


@dataclass(frozen=True, kw_only=True)
class Disturbance:
    """How far rehearsals differ from the nominal one."""

    joints: float = np.radians(3.0)
    """Standard deviation of the start angles [rad]."""
    root: float = np.radians(5.0)
    """Standard deviation of the root's turn about a random axis [rad]."""
    friction: tuple[float, float] = (0.4, 1.2)
    voltage: tuple[float, float] = (11.0, 12.6)
    """[V]"""


def disturb(
    stage: Stage,
    start: Array,
    n: int,
    disturbance: Disturbance,
    torque_limit: float,
    rng: np.random.Generator,
) -> tuple[Array, Conditions]:
    """Make the nominal start and conditions and ``n - 1`` disturbed ones.

    Args:
        stage: Robot and scene.
        start: Nominal MuJoCo positions, (nq,).
        n: How many in all.
        disturbance: How far they differ.
        torque_limit: Cap on every servo [N·m].
        rng: Source of the disturbances.
    """
    robot = stage.robot
    layout = robot.layout(stage.model)
    starts = np.tile(start, (n, 1))
    noise = rng.normal(scale=disturbance.joints, size=(n, robot.n))
    axis = rng.normal(size=(n, 3))
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    turn = rotation.from_axis_angle(axis, rng.normal(scale=disturbance.root, size=n))
    friction = rng.uniform(*disturbance.friction, size=n)
    voltage = rng.uniform(*disturbance.voltage, size=n)
    noise[0], turn[0], friction[0], voltage[0] = 0.0, rotation.IDENTITY, 0.8, robot.supply_voltage
    starts[:, layout.qpos] = np.clip(starts[:, layout.qpos] + noise, robot.lower, robot.upper)
    quaternion = slice(layout.root_qpos + 3, layout.root_qpos + 7)
    starts[:, quaternion] = rotation.multiply(turn, starts[:, quaternion])
    starts[1:, layout.root_qpos + 2] += 0.005  # the turn must not press it into the ground
    limits = np.full(n, torque_limit)
    return starts, Conditions(friction=friction, voltage=voltage, torque_limit=limits)
