"""Mirror pairs: which hinges mirror each other, by their positions and axes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robots.body.sides import swap_side
from robots.quaternion import Array

MIRROR = np.array([1.0, -1.0, 1.0])
"""Factors on the coordinates of a point reflected in the plane y = 0."""
MIRROR_AXIS = -MIRROR
"""Factors on the coordinates of an axis of rotation reflected there."""
FAR = 0.12  # share of the height; hinges farther from their mirror image are not a pair
ASKEW = np.cos(np.radians(35.0))
NAME_BONUS = 0.3


@dataclass(frozen=True, eq=False)
class MirrorPairs:
    """The counterpart of each of n hinges when left and right are exchanged."""

    index: np.ndarray
    """Counterpart of each hinge, (n,); a hinge in the middle is its own."""
    sign: Array
    """Sign of its angle there, (n,)."""
    unpaired: tuple[int, ...]
    """Hinges without a counterpart that are not in the middle."""


@dataclass(frozen=True, eq=False)
class MirrorImages:
    """How near the mirror image of each of n hinges is to each hinge."""

    apart: Array
    """Distance between the points on their axes [m], (n, n)."""
    along: Array
    """Cosine between the image's axis and the other's, (n, n)."""

    @classmethod
    def compare(cls, anchors: Array, axes: Array) -> MirrorImages:
        """Compare hinges by points [m] and axes, (n, 3) each; the plane of symmetry is y = 0."""
        return cls(_part(anchors), (axes * MIRROR_AXIS) @ axes.T)


def find_mirror(
    names: Sequence[str],
    anchors: Array,
    axes: Array,
    centers: Array,
    depths: Sequence[int],
    height: float,
) -> MirrorPairs:
    """Pair hinges by the positions and axes of their mirror images; names decide among equals.

    Args:
        names: Of the hinges.
        anchors: Points on their axes [m], (n, 3): x forward, y left, the plane of symmetry y = 0.
        axes: Unit vectors, (n, 3), in the same frame.
        centers: Centers of mass of all that each hinge moves [m], (n, 3), in the same frame; they
            tell hinges at one place apart, such as those of neck and clavicles.
        depths: Number of hinges above each.
        height: Of the robot [m], by which distances are measured.
    """
    images = MirrorImages.compare(anchors, axes)
    along = images.along
    apart = np.maximum(images.apart, 0.5 * _part(centers)) / height  # (n, n)
    deeper = np.abs(np.subtract.outer(depths, depths))
    cost = apart + 0.5 * (1.0 - np.abs(along)) + 0.02 * deeper
    swapped = np.array([swap_side(name) for name in names])
    named = (swapped[:, None] == np.array(names)) & ~np.eye(len(names), dtype=bool)  # (n, n)
    cost -= NAME_BONUS * named
    cost = cost + cost.T
    index, unpaired = np.full(len(names), -1), []
    for flat in np.argsort(cost, axis=None):
        j, k = divmod(int(flat), len(names))
        is_open = index[j] < 0 and index[k] < 0
        if is_open and (named[j, k] or (apart[j, k] < FAR and abs(along[j, k]) > ASKEW)):
            index[j], index[k] = k, j
    for j in np.flatnonzero(index < 0):
        index[j] = j
        unpaired.append(int(j))
    sign = np.where(along[np.arange(len(names)), index] < 0.0, -1.0, 1.0)
    return MirrorPairs(index, sign, tuple(unpaired))


def _part(points: Array) -> Array:
    """Measure how far the mirror image of each point is from each other one [m], (n, n)."""
    return np.linalg.norm((points * MIRROR)[:, None] - points[None], axis=-1)
