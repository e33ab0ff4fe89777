"""Wider or narrower shoulders: arms, the trunk's mass at their height, and beams in the gaps."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import mujoco
import numpy as np
from numpy.typing import NDArray

from robots.body.links import Link
from robots.quaternion import Array
from robots.reshaping.skeleton import Skeleton
from robots.reshaping.stretch import AxialStretch
from robots.reshaping.stretching import stretch_geom, stretch_inertia, write_pose

SIDEWAYS = np.array([0.0, 1.0, 0.0])
CONTACT = ("contype", "conaffinity", "condim", "friction", "solref", "solimp", "group", "rgba")
"""Attributes that a beam takes from the first colliding shape of the trunk."""


def stretch_shoulders(skeleton: Skeleton, factor: float) -> None:
    """Move the arms away from the midplane of the torso, or towards it.

    The shoulders are the trunk at the height of the arms' first links: its mass there is stretched
    sideways. A beam as thick as these links reaches from where each arm was to where it is; if
    the shoulders become narrower, so do the shapes at their height.
    """
    for trunk in dict.fromkeys(trunk for trunk, _ in skeleton.parts.arms):
        _stretch_trunk(skeleton, trunk, factor)
    beams = [_move_arm(skeleton, trunk, arm, factor) for trunk, arm in skeleton.parts.arms]
    for beam in beams:  # adding a shape changes the ids
        if beam is not None and factor > 1.0:
            beam.add()


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


def _move_arm(skeleton: Skeleton, trunk: Link, arm: Link, factor: float) -> _Beam | None:
    """Move an arm sideways; return the beam from where it was, if the arm's first link has shapes.

    In the torso's axes, the beam is as long as the arm has moved and as thick as that link.
    """
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
    quat = np.zeros(4)
    mujoco.mju_mat2Quat(quat, axes.T.ravel())
    return _Beam(
        owner=owner,
        like=next(
            (geom for body in skeleton.bodies(trunk) for geom in body.geoms if geom.contype), None
        ),
        name=f"{root.name}_shoulder",
        center=axes.T @ (box.mean(axis=0) - position),
        quat=quat,
        size=0.5 * np.ptp(box, axis=0),
    )


@dataclass(frozen=True, kw_only=True)
class _Beam:
    """A box between the trunk and an arm."""

    owner: mujoco.MjsBody
    """Body of the trunk that it belongs to."""
    like: mujoco.MjsGeom | None
    """Shape whose contact attributes the beam takes."""
    name: str
    center: Array
    """[m], in the body's frame, shape (3,)."""
    quat: Array
    """Orientation there, shape (4,)."""
    size: Array
    """Half edges [m], shape (3,)."""

    def add(self) -> None:
        """Add it to its body."""
        beam = self.owner.add_geom(name=self.name, type=mujoco.mjtGeom.mjGEOM_BOX)
        beam.pos, beam.quat, beam.size = self.center, self.quat, self.size
        for key in CONTACT if self.like is not None else ():
            setattr(beam, key, getattr(self.like, key))
