"""Self-overlap of a robot's shapes, by pairs of links."""

from __future__ import annotations

import mujoco
import numpy as np

from humanoid_getup.simulation.world import World
from robots import Posture
from robots.kinematics import place
from robots.quaternion import Array


def measure_overlap(model: mujoco.MjModel, data: mujoco.MjData) -> Array:
    """Measure how deep each pair of links overlaps [m], (nbody, nbody), from present contacts.

    Only the upper triangle is filled. Links that only touch, or are apart, have 0.
    """
    depth = np.zeros((model.nbody, model.nbody))
    links = np.sort(model.geom_bodyid[data.contact.geom], axis=1)  # (contacts, 2)
    own = np.all(model.body_weldid[links] != 0, axis=1)
    np.maximum.at(depth, tuple(links[own].T), -data.contact.dist[own])
    return depth


def find_overlap(world: World, posture: Posture, data: mujoco.MjData) -> Array:
    """Find how deep each pair of links overlaps in a posture [m], (nbody, nbody).

    ``data`` is scratch space.
    """
    data.qpos[:] = place(world.robot, world.model, posture)
    mujoco.mj_kinematics(world.model, data)
    mujoco.mj_comPos(world.model, data)
    mujoco.mj_collision(world.model, data)
    return measure_overlap(world.model, data)
