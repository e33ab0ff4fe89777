"""Ends of limbs: the far end of the shapes that its last joint moves."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from robots.body.links import gather_links
from robots.body.shapes import sample_shapes
from robots.quaternion import Array

SHARPNESS = 8  # power of the distance by which points count: those far away count alone
NO_WAY = 1e-6  # share of the largest distance below which points are around a joint on all sides


class LimbEnds:
    """Locates the ends of what the joints of a model move."""

    def __init__(self, model: mujoco.MjModel) -> None:
        self._model = model
        self._points: dict[int, tuple[Array, NDArray[np.int_]]] = {}

    def locate(self, data: mujoco.MjData, joint: int) -> Array:
        """Locate the end of the bodies that a joint moves, in the world, (3,) [m].

        It is in the middle of what is farthest from the joint: at the joint itself if that is in
        their middle. Bodies without shapes end at their center of mass.

        Args:
            data: Its kinematics and centers of mass.
            joint: The last one of a limb, or the one at which its last part begins.
        """
        points, owners = self._sample(joint)
        if not len(points):
            return data.subtree_com[self._model.jnt_bodyid[joint]]
        axes = data.xmat[owners].reshape(-1, 3, 3)
        start = data.xanchor[joint]
        ways = data.xpos[owners] + np.einsum("pij,pj->pi", axes, points) - start  # (p, 3)
        distances = np.linalg.norm(ways, axis=1)
        weights = (distances / distances.max()) ** SHARPNESS
        middle = weights @ ways / weights.sum()
        length = float(np.linalg.norm(middle))
        if length < NO_WAY * distances.max():
            return start.copy()
        return start + middle / length * np.max(ways @ middle) / length

    def _sample(self, joint: int) -> tuple[Array, NDArray[np.int_]]:
        """Return points that span the bodies that a joint moves, (p, 3) [m], and their bodies."""
        if joint not in self._points:
            bodies = gather_links(self._model, int(self._model.jnt_bodyid[joint])).list_bodies()
            sampled = {body: sample_shapes(self._model, body) for body in bodies}
            owners = [np.full(len(points), body) for body, points in sampled.items()]
            self._points[joint] = np.concatenate([*sampled.values()]), np.concatenate(owners)
        return self._points[joint]
