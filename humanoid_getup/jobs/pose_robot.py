"""Poses a robot: drops it, mirrors it, and measures how it lies."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from humanoid_getup.experiments.starts.falls import UNCLASSED, Fall, classify, drop_from
from humanoid_getup.jobs.errors import refusing
from humanoid_getup.jobs.inputs import find_start
from humanoid_getup.simulation.clearance import Clearance
from humanoid_getup.simulation.world import World
from robots import Posture
from robots.kinematics import mirror_positions, place, read_posture


@dataclass(frozen=True, kw_only=True)
class PoseFigures:
    """How a robot is posed."""

    side: str
    """Class of a robot that lies so, or other."""
    tilt: float
    """Angle between the torso and the vertical [rad]."""
    overlap: float
    """Greatest depth to which the robot is inside the ground or an obstacle [m]."""
    self_overlap: float
    """Greatest depth to which it is inside itself [m]."""


def sample_start(world: World, side: str, seed: int) -> Fall:
    """Sample a settled fall of a class.

    Raises:
        BadInputError: if there is no such class, or it does not occur.
    """
    return find_start(world, side, np.random.default_rng(seed))


def drop_robot(world: World, posture: Posture) -> Fall:
    """Drop a limp robot from a posture, and let it settle.

    Raises:
        BadInputError: if it does not come to rest.
    """
    with refusing():
        return drop_from(world, posture)


def mirror_pose(world: World, posture: Posture) -> Posture:
    """Exchange left and right of a posture."""
    qpos = place(world.robot, world.model, posture)
    return read_posture(world.robot, world.model, mirror_positions(world.robot, world.model, qpos))


def put_down(world: World, posture: Posture) -> Posture:
    """Move a posture up or down until it touches what is under it."""
    qpos = Clearance(world).rest_where(place(world.robot, world.model, posture))
    root = world.robot.layout(world.model).root_position
    return replace(posture, position=qpos[root].copy())


def measure_pose(world: World, posture: Posture) -> PoseFigures:
    """Measure how a robot is posed."""
    qpos, clearance = place(world.robot, world.model, posture), Clearance(world)
    return PoseFigures(
        side=classify(posture.orientation) or UNCLASSED,
        tilt=float(np.arccos(np.clip(-posture.gravity_b[2], -1.0, 1.0))),
        overlap=clearance.measure_overlap(qpos),
        self_overlap=clearance.measure_self_overlap(qpos),
    )
