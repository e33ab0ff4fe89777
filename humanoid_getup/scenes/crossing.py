"""Crossings: capsules of a robot that pass through a box further than contacts tell."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from robots.quaternion import Array

SMALL = 1e-12  # m, of an axis parallel to a face
NONE = np.zeros((0, 2), dtype=int)


class Crossings:
    """Finds capsules whose axis meets a box of the scene, where no contact is as deep.

    MuJoCo's contacts between a capsule and a box are exact while the axis is outside the box. A
    limb that passes through a wall may have none at all.
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        self._model = model
        is_world = model.body_weldid[model.geom_bodyid] == 0
        self._capsules = np.flatnonzero(
            ~is_world & (model.geom_type == mujoco.mjtGeom.mjGEOM_CAPSULE)
        )
        self._boxes = np.flatnonzero(is_world & (model.geom_type == mujoco.mjtGeom.mjGEOM_BOX))
        self._half = model.geom_size[self._capsules, 1:2]

    def find(self, data: mujoco.MjData) -> NDArray[np.int_]:
        """Find pairs of a capsule and a box, (K, 2), after collision detection."""
        if not (self._boxes.size and self._capsules.size):
            return NONE
        center = data.geom_xpos[self._capsules]
        along = self._half * data.geom_xmat[self._capsules][:, [2, 5, 8]]
        found = [
            (capsule, box)
            for box in self._boxes.tolist()
            for capsule in self._capsules[self._meets(data, box, center, along)].tolist()
        ]
        deep = [pair for pair in found if self._measure_contact(data, pair) < self.depth(pair[0])]
        return np.array(deep, dtype=int) if deep else NONE

    def depth(self, capsule: int) -> float:
        """Return how deep such a capsule is in the box at least [m]."""
        return float(self._model.geom_size[capsule, 0])

    def _meets(
        self, data: mujoco.MjData, box: int, center: Array, along: Array
    ) -> NDArray[np.bool_]:
        """Return which segments (N, 3) meet a box, by the slabs between its faces."""
        turn, half = data.geom_xmat[box].reshape(3, 3), self._model.geom_size[box]
        middle, way = (center - data.geom_xpos[box]) @ turn, along @ turn
        way += SMALL * (way == 0.0)
        near, far = (-half - middle) / way, (half - middle) / way
        enter = np.minimum(near, far).max(axis=1)
        leave = np.maximum(near, far).min(axis=1)
        return np.maximum(enter, -1.0) <= np.minimum(leave, 1.0)

    def _measure_contact(self, data: mujoco.MjData, pair: tuple[int, int]) -> float:
        contact = data.contact
        is_pair = np.isin(contact.geom, pair).all(axis=1)
        return float(np.max(-contact.dist[is_pair], initial=0.0))
