"""Long directions of the links of a limb."""

from __future__ import annotations

import mujoco
import numpy as np

from robots.body.ends import LimbEnds
from robots.body.links import Link
from robots.proportions import BodyError
from robots.quaternion import Array
from robots.reshaping.skeleton import Skeleton

LONG = 0.5  # share of the longest link's length; shorter ones are brackets between two joints
NEAR_AXIS = np.cos(np.radians(30.0))
LEAST_LENGTH = 1e-6  # m
WITH_AXES = (
    mujoco.mjtGeom.mjGEOM_BOX,
    mujoco.mjtGeom.mjGEOM_CAPSULE,
    mujoco.mjtGeom.mjGEOM_CYLINDER,
    mujoco.mjtGeom.mjGEOM_ELLIPSOID,
)


def find_directions(skeleton: Skeleton, limb: Link) -> dict[Link, Array]:
    """Find the long direction of each link of a limb, a unit vector in its frame, (3,).

    It points from a link's joint to the next one. Brackets, which are too short for that, and
    feet follow the long link next to them, with all joints at zero.

    Raises:
        BodyError: if the limb has no length.
    """
    reach = {link: _compute_reach(skeleton, link, limb) for link in limb.walk()}
    length = {link: float(np.linalg.norm(vector)) for link, vector in reach.items()}
    if max(length.values()) < LEAST_LENGTH:
        raise BodyError(
            f"the limb '{skeleton.root(limb).name}' has no length, expected a shape with mass"
        )
    long = {link for link in reach if length[link] >= LONG * max(length.values())}
    directions: dict[Link, Array] = {}
    for link in limb.walk():
        below = next((other for other in link.walk() if other in long), None)
        if below is not None:
            own = _snap(skeleton, below, reach[below] / length[below])
            directions[link] = skeleton.turn(own, below, link)
        else:
            above = next(other for other in directions if link in other.children)
            directions[link] = skeleton.turn(directions[above], above, link)
    return directions


def _compute_reach(skeleton: Skeleton, link: Link, limb: Link) -> Array:
    """Compute the vector from a link's joint to the next, or to the end of the last link, (3,).

    A foot has none, unless it is the whole limb.
    """
    start = link.anchor()
    if skeleton.has_sole(link):
        return skeleton.sole(link) - start if link is limb else np.zeros(3)
    if link.children:
        return np.mean([skeleton.anchor_in(end, link) for end in link.children], axis=0) - start
    end = LimbEnds(skeleton.model).locate(skeleton.data, link.joints[0])
    return skeleton.axes(link).T @ (end - skeleton.data.xanchor[link.joints[0]])


def _snap(skeleton: Skeleton, link: Link, direction: Array) -> Array:
    """Turn a direction to the nearest axis of the link's largest shape, or of its frame.

    A box that is stretched along an axis of its own stays a box.
    """
    model, axes = skeleton.model, [np.eye(3)]
    geoms = [geom for geom in link.geoms if int(model.geom_type[geom]) in WITH_AXES]
    if geoms:
        largest = max(geoms, key=lambda i: np.prod(model.geom_aabb[i, 3:]))
        in_world = skeleton.data.geom_xmat[largest].reshape(3, 3)
        axes.insert(0, skeleton.axes(link).T @ in_world)
    for candidates in axes:
        cosines = direction @ candidates  # (3,)
        best = int(np.argmax(np.abs(cosines)))
        if abs(cosines[best]) > NEAR_AXIS:
            return np.sign(cosines[best]) * candidates[:, best]
    return direction
