"""Overlap: how deep a body's shapes reach into each other."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from robots.quaternion import Array

DEEP = 0.001  # m; shapes that only touch are less deep in each other
Pair = tuple[int, int]


def list_self_contacts(
    model: mujoco.MjModel, data: mujoco.MjData
) -> tuple[NDArray[np.integer], Array]:
    """List the present contacts of moving bodies with others of the same tree.

    Returns:
        The two bodies of each, the lower one first, (c, 2), and how deep they are [m], (c,);
        negative for shapes that are still apart.
    """
    bodies = np.sort(model.geom_bodyid[data.contact.geom], axis=1)
    root = model.body_rootid[bodies]
    own = root[:, 0] == root[:, 1]  # what is fixed in the world does not collide with itself
    return bodies[own], -data.contact.dist[own]


def measure_self_overlap(model: mujoco.MjModel, data: mujoco.MjData) -> float:
    """Measure how deep a body reaches into itself, by the present contacts [m]."""
    return float(list_self_contacts(model, data)[1].max(initial=0.0))


def measure_pair_overlaps(model: mujoco.MjModel, data: mujoco.MjData) -> Array:
    """Measure how deep each pair of bodies overlaps [m], (nbody, nbody), by the present contacts.

    Only the upper triangle is filled. Bodies that only touch, or are apart, have 0.
    """
    deepest = np.zeros((model.nbody, model.nbody))
    bodies, depth = list_self_contacts(model, data)
    np.maximum.at(deepest, tuple(bodies.T), depth)
    return deepest


def overlaps_at(model: mujoco.MjModel, qpos: Array, data: mujoco.MjData) -> Array:
    """Measure the same at MuJoCo positions (nq,); ``data`` is scratch space."""
    data.qpos[:] = qpos
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    mujoco.mj_collision(model, data)
    return measure_pair_overlaps(model, data)


def find_overlaps(model: mujoco.MjModel, qpos: Array) -> dict[Pair, float]:
    """Find bodies that reach into each other, and how deep [m], at MuJoCo positions (nq,)."""
    depth = overlaps_at(model, qpos, mujoco.MjData(model))
    pairs = zip(*(rows.tolist() for rows in np.nonzero(depth > DEEP)), strict=True)
    return {(a, b): float(depth[a, b]) for a, b in pairs}
