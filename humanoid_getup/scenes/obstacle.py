"""Obstacles: spheres, capsules and boxes in the way or for support."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import mujoco
import numpy as np
from numpy.typing import NDArray

from humanoid_getup.scenes.ground import Surface
from robots import quaternion
from robots.ground import add_world_geom
from robots.quaternion import Array

Kind = Literal["sphere", "capsule", "box"]
TYPES = {
    "sphere": mujoco.mjtGeom.mjGEOM_SPHERE,
    "capsule": mujoco.mjtGeom.mjGEOM_CAPSULE,
    "box": mujoco.mjtGeom.mjGEOM_BOX,
}
COLOR = (0.62, 0.45, 0.30, 1.0)
THINNEST = 1e-6  # m, of a box without radius


@dataclass(frozen=True, kw_only=True, eq=False)
class Obstacle:
    """A sphere-swept volume: every point within ``radius`` of a point, a segment or a rectangle.

    Departure from [Lin12], section 4.2.2: the edges of a box are sharp.
    """

    name: str
    kind: Kind
    half_size: Array
    """Size as in MuJoCo: radius; radius and half length along z; or half edges [m]."""
    position: Array
    """Position of its center in the world [m], (3,)."""
    orientation: Array = field(default_factory=lambda: np.array([1.0, 0.0, 0.0, 0.0]))
    surface: Surface = field(default_factory=Surface)

    @property
    def radius(self) -> float:
        """Return the radius of the sphere that is swept [m]."""
        return float(self.half_size.min() if self.kind == "box" else self.half_size[0])

    def sweep(self, radius: float) -> Array:
        """Return its half sizes with a smaller swept sphere [m], (k,)."""
        if self.kind == "box":
            return np.maximum(self.half_size - (self.radius - radius), THINNEST)
        return np.array([max(radius, THINNEST), *self.half_size[1:]])

    def contains(self, point: Array) -> bool:
        """Return whether a point (3,) is inside."""
        p = self._to_local(point)
        if self.kind == "box":
            return bool(np.all(np.abs(p) <= self.half_size))
        p[2] -= np.clip(p[2], -self._half_length, self._half_length)
        return bool(np.linalg.norm(p) <= self.radius)

    def top(self, x: Array, y: Array) -> Array:
        """Compute the height of its highest point over places x, y [m]; -inf beside it."""
        origin = self._to_local(np.stack([x, y, np.zeros_like(x)], axis=-1))
        up = quaternion.rotate(quaternion.inverse(self.orientation), np.array([0.0, 0.0, 1.0]))
        if self.kind == "box":
            return _leave_box(origin, up, self.half_size)
        ends = np.array([[0.0, 0.0, z] for z in (-self._half_length, self._half_length)])
        sides = _leave_cylinder(origin, up, self.radius, self._half_length)
        return np.max([sides, *(_leave_sphere(origin - end, up, self.radius) for end in ends)], 0)

    def add(self, spec: mujoco.MjSpec) -> None:
        """Add it to a model."""
        geom = add_world_geom(spec, self.name, self.surface.friction)
        geom.type = TYPES[self.kind]
        geom.size[: len(self.half_size)] = self.half_size
        geom.pos[:], geom.quat[:] = self.position, self.orientation
        geom.rgba[:] = COLOR
        self.surface.cover(geom)

    @property
    def _half_length(self) -> float:
        return float(self.half_size[1]) if self.kind == "capsule" else 0.0

    def _to_local(self, point: Array) -> Array:
        return quaternion.rotate(quaternion.inverse(self.orientation), point - self.position)


def make_capsule(
    name: str, start: Array, end: Array, radius: float, surface: Surface | None = None
) -> Obstacle:
    """Make a capsule around a segment; a sphere if both ends are the same point [m], (3,)."""
    along, surface = end - start, surface or Surface()
    length = float(np.linalg.norm(along))
    if length == 0.0:
        size = np.array([radius])
        return Obstacle(name=name, kind="sphere", half_size=size, position=start, surface=surface)
    orientation = np.zeros(4)
    mujoco.mju_quatZ2Vec(orientation, along / length)
    return Obstacle(
        name=name,
        kind="capsule",
        half_size=np.array([radius, 0.5 * length]),
        position=0.5 * (start + end),
        orientation=orientation,
        surface=surface,
    )


def _leave_box(origin: Array, up: Array, half: Array) -> Array:
    """Compute the distance along ``up`` at which lines (..., 3) leave a box; -inf if they miss."""
    with np.errstate(divide="ignore", invalid="ignore"):
        near = (-half * np.sign(up) - origin) / up
        far = (half * np.sign(up) - origin) / up
    parallel = np.abs(up) < 1e-12
    outside = np.any(parallel & (np.abs(origin) > half), axis=-1)
    enter = np.where(parallel, -np.inf, near).max(axis=-1)
    leave = np.where(parallel, np.inf, far).min(axis=-1)
    return np.where(outside | (enter > leave), -np.inf, leave)


def _leave_sphere(origin: Array, up: Array, radius: float) -> Array:
    along = origin @ up
    square = along**2 - np.sum(origin**2, axis=-1) + radius**2
    return np.where(square < 0.0, -np.inf, -along + np.sqrt(np.maximum(square, 0.0)))


def _leave_cylinder(origin: Array, up: Array, radius: float, half_length: float) -> Array:
    """Compute the same of a cylinder along z, without its ends."""
    a = float(up[:2] @ up[:2])
    if a < 1e-12:
        return np.full(origin.shape[:-1], -np.inf)
    b = origin[..., :2] @ up[:2]
    square = b**2 - a * (np.sum(origin[..., :2] ** 2, axis=-1) - radius**2)
    leave = (-b + np.sqrt(np.maximum(square, 0.0))) / a
    z = origin[..., 2] + leave * up[2]
    return np.where((square < 0.0) | (np.abs(z) > half_length), -np.inf, leave)


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
