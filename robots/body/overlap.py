"""Overlap: how deep the shapes of a body penetrate each other."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from robots.quaternion import Array

DEEP = 0.001  # m; shapes that only touch are less deep in each other
Pair = tuple[int, int]


def find_self_contacts(model: mujoco.MjModel, data: mujoco.MjData) -> NDArray[np.bool_]:
    """Find which of the present contacts are between bodies of one tree, (ncon,).

    What is fixed in the world does not collide with itself.
    """
    root = model.body_rootid[model.geom_bodyid[data.contact.geom]]  # (ncon, 2)
    return root[:, 0] == root[:, 1]


def measure_self_overlap(model: mujoco.MjModel, data: mujoco.MjData) -> float:
    """Measure how deep a body penetrates itself, by the present contacts [m]."""
    own = find_self_contacts(model, data)
    return float(np.max(-data.contact.dist[own], initial=0.0))


def measure_pair_overlaps(model: mujoco.MjModel, data: mujoco.MjData) -> Array:
    """Measure how deep each pair of bodies overlaps [m], (nbody, nbody), by the present contacts.

    Only the upper triangle is filled. Bodies that only touch, or are apart, have 0.
    """
    deepest = np.zeros((model.nbody, model.nbody))
    own = find_self_contacts(model, data)
    bodies = np.sort(model.geom_bodyid[data.contact.geom[own]], axis=1)
    np.maximum.at(deepest, tuple(bodies.T), -data.contact.dist[own])
    return deepest


def overlaps_at(model: mujoco.MjModel, qpos: Array, data: mujoco.MjData) -> Array:
    """Measure the same at MuJoCo positions (nq,); ``data`` is scratch space."""
    data.qpos[:] = qpos
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    mujoco.mj_collision(model, data)
    return measure_pair_overlaps(model, data)


def find_overlaps(model: mujoco.MjModel, qpos: Array) -> dict[Pair, float]:
    """Find bodies that penetrate each other, and how deep [m], at MuJoCo positions (nq,)."""
    depth = overlaps_at(model, qpos, mujoco.MjData(model))
    pairs = zip(*(rows.tolist() for rows in np.nonzero(depth > DEEP)), strict=True)
    return {(a, b): float(depth[a, b]) for a, b in pairs}
