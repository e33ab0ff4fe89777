"""Crossings: capsules of a robot that pass through a box deeper than contacts show."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

SMALL = 1e-12  # m, of an axis parallel to a face
NONE = np.zeros((0, 2), dtype=int)


class Crossings:
    """Finds capsules whose axis passes through a box of the scene, which contacts may miss.

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
        # The scene does not move: where its boxes are is computed once.
        data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
        self._turn = data.geom_xmat[self._boxes].reshape(-1, 3, 3)  # (B, 3, 3)
        place = data.geom_xpos[self._boxes]
        self._place = np.einsum("bi,bij->bj", place, self._turn)[:, None]  # (B, 1, 3)
        self._size = model.geom_size[self._boxes][:, None]  # (B, 1, 3)
        self._half = model.geom_size[self._capsules, 1:2]  # (N, 1)
        self._axis = self._capsules[:, None] * 9 + [2, 5, 8]  # (N, 3), in a row of matrices

    def find(self, data: mujoco.MjData) -> NDArray[np.int_]:
        """Find pairs of a capsule and a box, (K, 2), after collision detection."""
        if not (self._boxes.size and self._capsules.size):
            return NONE
        meets = self._find_meeting(data)
        if not meets.any():
            return NONE
        boxes, capsules = np.nonzero(meets)
        found = zip(self._capsules[capsules].tolist(), self._boxes[boxes].tolist(), strict=True)
        deep = [pair for pair in found if self._measure_contact(data, pair) < self.depth(pair[0])]
        return np.array(deep, dtype=int) if deep else NONE

    def depth(self, capsule: int) -> float:
        """Return the smallest depth of such a capsule in the box [m]."""
        return float(self._model.geom_size[capsule, 0])

    def _find_meeting(self, data: mujoco.MjData) -> NDArray[np.bool_]:
        """Find intersections of capsule axes with boxes, (B, N), by the slab method."""
        along = self._half * data.geom_xmat.ravel()[self._axis]
        way = along @ self._turn  # (B, N, 3), in the frames of the boxes
        middle = data.geom_xpos[self._capsules] @ self._turn - self._place
        per = 1.0 / (way + SMALL)
        center, reach = middle * per, self._size * np.abs(per)
        enter = np.maximum.reduce(-center - reach, axis=2)
        leave = np.minimum.reduce(reach - center, axis=2)
        return np.maximum(enter, -1.0) <= np.minimum(leave, 1.0)

    def _measure_contact(self, data: mujoco.MjData, pair: tuple[int, int]) -> float:
        geoms = data.contact.geom
        is_pair = (geoms[:, 0] == pair[0]) & (geoms[:, 1] == pair[1])
        is_pair |= (geoms[:, 0] == pair[1]) & (geoms[:, 1] == pair[0])
        return float(np.max(-data.contact.dist[is_pair], initial=0.0))
