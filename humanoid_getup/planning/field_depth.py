"""Depth of a robot's parts under the surface of a height field."""

from __future__ import annotations

import itertools

import mujoco
import numpy as np
from numpy.typing import NDArray

from humanoid_getup.scenes.ground import Ground
from robots.quaternion import Array

ROUND = (mujoco.mjtGeom.mjGEOM_CAPSULE, mujoco.mjtGeom.mjGEOM_SPHERE)
CORNERS = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))


class FieldDepth:
    """Measures how far points on the robot's geoms are under the ground.

    Contacts with a height field push a body out by the nearest side of a cell, which may be any;
    how far it must be raised, they do not tell.
    """

    def __init__(self, model: mujoco.MjModel, geoms: NDArray[np.intp], ground: Ground) -> None:
        """Take the corners of boxes, and of the boxes about other geoms' axes and ends."""
        self._ground = ground
        points, radii, owners = [], [], []
        for geom in geoms.tolist():
            size = model.geom_aabb[geom, 3:].copy()
            center, radius = model.geom_aabb[geom, :3], 0.0
            if int(model.geom_type[geom]) in ROUND:
                radius = float(model.geom_size[geom, 0])
                size -= radius
            corners = np.unique(center + size * CORNERS, axis=0)
            points.append(corners)
            radii.append(np.full(len(corners), radius))
            owners.append(np.full(len(corners), geom))
        self._points, self._radius = np.concatenate(points), np.concatenate(radii)
        self.geom = np.concatenate(owners)
        """Geom of each point, (P,)."""

    def measure(self, data: mujoco.MjData) -> Array:
        """Measure the depth of each point under the ground [m], (P,); negative above it."""
        turn = data.geom_xmat[self.geom].reshape(-1, 3, 3)
        at = data.geom_xpos[self.geom] + np.einsum("pij,pj->pi", turn, self._points)
        return self._ground.height(at[:, 0], at[:, 1]) - at[:, 2] + self._radius
