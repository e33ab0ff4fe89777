"""Domain randomization of rollouts: starts, friction and supply differ from the nominal."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from humanoid_getup.simulation.domain_parameters import DomainParameters
from humanoid_getup.simulation.world import World
from robots import quaternion
from robots.kinematics import lowest_point
from robots.quaternion import Array


@dataclass(frozen=True, kw_only=True)
class RolloutRandomization:
    """Spread of the randomized rollouts about the nominal one."""

    joints: float = np.radians(3.0)
    """Standard deviation of the start angles [rad]."""
    root: float = np.radians(5.0)
    """Standard deviation of the root's rotation about a random axis [rad]."""
    friction: tuple[float, float] = (0.4, 1.2)
    """Range of the sliding friction."""
    supply: tuple[float, float] = (11.0 / 12.0, 12.6 / 12.0)
    """Range, as a share of the robot's nominal supply."""


def randomize_rollouts(
    world: World,
    start: Array,
    n: int,
    randomization: RolloutRandomization,
    torque_limit: float,
    rng: np.random.Generator,
) -> tuple[Array, DomainParameters]:
    """Make starts, MuJoCo positions (n, nq), and parameters, of which the first are nominal.

    The nominal ``start`` has shape (nq,); the torque limit [N·m] is that of every servo.
    """
    robot = world.robot
    layout = robot.layout(world.model)
    starts = np.tile(start, (n, 1))
    noise = rng.normal(scale=randomization.joints, size=(n, robot.n))
    axis = rng.normal(size=(n, 3))
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    turn = quaternion.from_axis_angle(axis, rng.normal(scale=randomization.root, size=n))
    friction = rng.uniform(*randomization.friction, size=n)
    supply = rng.uniform(*randomization.supply, size=n)
    noise[0], turn[0], friction[0], supply[0] = 0.0, quaternion.IDENTITY, world.scene.friction, 1.0
    starts[:, layout.qpos] = np.clip(starts[:, layout.qpos] + noise, robot.lower, robot.upper)
    root = starts[:, layout.root_orientation]  # a view
    root[:] = quaternion.multiply(turn, root)
    rest = lowest_point(world.model, start)
    for row in starts[1:]:  # the rotation must neither lift it off the ground nor press it in
        row[layout.root_qpos + 2] += rest - lowest_point(world.model, row)
    voltage = supply * robot.supply_voltage
    return starts, DomainParameters.nominal(
        world, n, friction=friction, voltage=voltage, torque_limit=torque_limit
    )
