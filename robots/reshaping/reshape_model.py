"""Reshaping a model: its torso, shoulders, arms and legs become longer or shorter."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial

import mujoco
import numpy as np
from numpy.typing import NDArray

from robots import quaternion
from robots.body.joint_view import LimbEnds
from robots.body.parts import Link, list_head_joints
from robots.individual import make_explicit
from robots.proportions import Body, BodyError
from robots.quaternion import Array
from robots.reshaping.stretching import (
    AxialStretch,
    Skeleton,
    stretch_geom,
    stretch_inertia,
    stretch_link,
    write_pose,
)
from robots.robot import Robot

SIDEWAYS = np.array([0.0, 1.0, 0.0])
CONTACT = ("contype", "conaffinity", "condim", "friction", "solref", "solimp", "group", "rgba")
"""Attributes that a beam takes from the first colliding shape of the trunk, if any."""


def stretch_shoulders(skeleton: Skeleton, factor: float) -> None:
    """Move the arms away from the midplane of the torso, or towards it.

    The shoulders are the trunk at the height of the arms' first links: its mass there is stretched
    sideways. A beam as thick as these links reaches from where each arm was to where it is; if
    the shoulders become narrower, so do the shapes at their height.
    """
    for trunk in dict.fromkeys(trunk for trunk, _ in skeleton.parts.arms):
        _stretch_trunk(skeleton, trunk, factor)
    beams = [_move_arm(skeleton, trunk, arm, factor) for trunk, arm in skeleton.parts.arms]
    for add_beam in beams:  # adding a shape changes the ids
        if add_beam is not None and factor > 1.0:
            add_beam()


def _stretch_trunk(skeleton: Skeleton, trunk: Link, factor: float) -> None:
    """Stretch a trunk's mass sideways at the height of its arms, and narrow its shapes there."""
    boxes = [
        skeleton.bounds(arm, skeleton.torso) for owner, arm in skeleton.parts.arms if owner is trunk
    ]
    heights = np.array([box[:, 2] for box in boxes if box is not None])
    if len(heights) == 0:
        return
    low, high = float(heights.min()), float(heights.max())
    for body in skeleton.bodies(trunk):
        position, axes = skeleton.pose(body.id, skeleton.torso)
        stretch = AxialStretch(np.zeros(3), SIDEWAYS, factor).seen_from(position, axes)
        base, up = float(position[2]), axes[2]
        stretch_inertia(body, stretch, where=partial(_is_between, low - base, high - base, up))
        for geom in body.geoms if factor < 1.0 else ():
            bottom, top = skeleton.bounds_of(geom.id, skeleton.torso)[:, 2]
            if bottom < high and top > low:
                stretch_geom(skeleton, geom, stretch)


def _is_between(low: float, high: float, up: Array, points: Array) -> NDArray[np.bool_]:
    """Return which points (K, 3) are at heights [m] along a direction (3,), (K,)."""
    height = points @ up
    return (height >= low) & (height <= high)


def _move_arm(
    skeleton: Skeleton, trunk: Link, arm: Link, factor: float
) -> Callable[[], None] | None:
    """Move an arm sideways; return what adds the beam from where it was, as thick as its link."""
    root = skeleton.root(arm)
    owner = next(body for body in skeleton.bodies(trunk) if root in body.bodies)
    position, axes = skeleton.pose(owner.id, skeleton.torso)
    start = skeleton.model.body_pos[arm.root].copy()
    end = AxialStretch(np.zeros(3), SIDEWAYS, factor).seen_from(position, axes)(start)
    write_pose(root, owner, end, skeleton.model.body_quat[arm.root])
    box = skeleton.bounds(arm, skeleton.torso)
    if box is None:
        return None
    box[:, 1] = np.sort((np.array([start, end]) @ axes.T + position)[:, 1])
    quat = quaternion.from_matrix(axes.T)
    geoms = (geom for body in skeleton.bodies(trunk) for geom in body.geoms)
    like = next((geom for geom in geoms if geom.contype), None)

    def add_beam() -> None:
        beam = owner.add_geom(name=f"{root.name}_shoulder", type=mujoco.mjtGeom.mjGEOM_BOX)
        beam.pos, beam.quat = axes.T @ (box.mean(axis=0) - position), quat
        beam.size = 0.5 * np.ptp(box, axis=0)
        for key in CONTACT if like is not None else ():
            setattr(beam, key, getattr(like, key))

    return add_beam


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
    """Compute the way from a link's joint to the next, or its end, (3,); 0 for most feet."""
    start = link.anchor()
    if skeleton.has_sole(link):
        return skeleton.sole(link) - start if link is limb else np.zeros(3)
    if link.children:
        return np.mean([skeleton.anchor_in(end, link) for end in link.children], axis=0) - start
    end = LimbEnds(skeleton.model).locate(skeleton.data, link.joints[0])
    return skeleton.axes(link).T @ (end - skeleton.data.xanchor[link.joints[0]])


def _snap(skeleton: Skeleton, link: Link, direction: Array) -> Array:
    """Turn a direction to the nearest axis of the largest shape, so that a box stays one."""
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


UPWARDS = np.array([0.0, 0.0, 1.0])


def reshape_model(spec: mujoco.MjSpec, robot: Robot, body: Body) -> None:
    """Give a robot's model, without servos, the lengths of a body."""
    make_explicit(spec)
    for link in spec.bodies:
        if link.frames:
            link.add_frame()  # the last one: where it is put, a pose is one in the body
    for part, change in _CHANGES.items():
        factor = getattr(body, part)
        if factor == 1.0:
            continue
        head = list_head_joints(robot)
        skeleton = Skeleton(spec, torso=robot.torso, sole_sites=robot.sole_sites, head_joints=head)
        if part in ("shoulders", "arms") and not skeleton.parts.arms:
            raise BodyError(
                f"body '{body}': robot '{robot.name}' has no arms, expected torso or legs alone"
            )
        change(skeleton, factor)


def _stretch_torso(skeleton: Skeleton, factor: float) -> None:
    """Stretch the trunk upwards; what is below the hips stays."""
    torso = skeleton.torso
    legs = [leg.root for _, leg in skeleton.parts.legs]
    hips = [skeleton.anchor_in(leg, torso) for owner, leg in skeleton.parts.legs if owner is torso]
    for link in skeleton.parts.trunk:
        up = skeleton.turn(UPWARDS, torso, link)
        at_hips = link is torso and hips
        origin = np.mean(hips, axis=0) if at_hips else link.anchor()
        stretch_link(skeleton, link, AxialStretch(origin, up, factor, beyond=True), kept=legs)


def _stretch_limbs(skeleton: Skeleton, limbs: Iterable[tuple[Link, Link]], factor: float) -> None:
    for _, limb in limbs:
        for link, direction in find_directions(skeleton, limb).items():
            stretch_link(skeleton, link, AxialStretch(link.anchor(), direction, factor))


_CHANGES: dict[str, Callable[[Skeleton, float], None]] = {
    "torso": _stretch_torso,
    "shoulders": stretch_shoulders,
    "arms": lambda skeleton, factor: _stretch_limbs(skeleton, skeleton.parts.arms, factor),
    "legs": lambda skeleton, factor: _stretch_limbs(skeleton, skeleton.parts.legs, factor),
}
"""In this order, because shoulders are as thick as the unstretched first links of the arms."""


@dataclass(frozen=True, kw_only=True, repr=False)
class ReshapedRobot(Robot):
    """A robot whose model has the lengths of `body`; servos and joints stay the same."""

    def read_model(self) -> mujoco.MjSpec:
        """Read the model, and give it the body's lengths."""
        spec = super().read_model()
        reshape_model(spec, self, self.body)
        return spec
