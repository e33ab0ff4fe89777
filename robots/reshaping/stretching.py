"""Stretching the parts of a model: poses, shapes, and how mass is distributed."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from robots import quaternion
from robots.body.parts import Link, LinkFrames, find_parts
from robots.proportions import BodyError
from robots.quaternion import Array

NODES = 32  # of the quadrature along each axis; 2 are exact where a whole body is stretched


@dataclass(frozen=True)
class AxialStretch:
    """A map of points that moves them along a direction, away from or towards a plane."""

    origin: Array
    """A point that stays [m], shape (3,)."""
    direction: Array
    """Unit vector, shape (3,)."""
    factor: float
    beyond: bool = False
    """Whether only points beyond the plane through ``origin`` are stretched."""

    def __call__(self, points: Array) -> Array:
        """Move points (..., 3) [m]."""
        height = (points - self.origin) @ self.direction  # (...)
        stretched = np.maximum(height, 0.0) if self.beyond else height
        return points + (self.factor - 1.0) * stretched[..., None] * self.direction

    def growth(self, points: Array) -> Array:
        """Compute the factor on length, and so on mass, at points (..., 3), (...)."""
        height = (points - self.origin) @ self.direction
        return (
            np.where(height < 0.0, 1.0, self.factor)
            if self.beyond
            else np.full_like(height, self.factor)
        )

    def seen_from(self, position: Array, axes: Array) -> AxialStretch:
        """Express it in a frame at a position (3,) with axes in columns, (3, 3)."""
        origin = axes.T @ (self.origin - position)
        return replace(self, origin=origin, direction=axes.T @ self.direction)

    def extend(self, center: Array, half: Array) -> tuple[Array, Array]:
        """Stretch a straight piece: the point between its ends, and the vector to one, (3,)."""
        start, end = self(np.stack([center - half, center + half]))
        return 0.5 * (start + end), 0.5 * (end - start)


@dataclass(frozen=True)
class Inertia:
    """How mass is distributed in a body."""

    mass: float
    """[kg]"""
    center: Array
    """Center of mass [m], shape (3,)."""
    spread: Array
    """Integral of r rᵀ dm about the center of mass [kg·m²], shape (3, 3)."""

    @classmethod
    def from_principal(cls, mass: float, center: Array, axes: Array, moments: Array) -> Inertia:
        """Make it from principal moments [kg·m²], (3,), about axes in columns, (3, 3)."""
        spread = axes @ np.diag(0.5 * moments.sum() - moments) @ axes.T
        return cls(mass, center, spread)

    def principal(self) -> tuple[Array, Array]:
        """Compute the principal moments [kg·m²], (3,), and axes as a quaternion, (4,)."""
        spread, axes = np.linalg.eigh(self.spread)
        axes[:, 2] *= np.sign(np.linalg.det(axes))
        return spread.sum() - spread, quaternion.from_matrix(axes)

    def stretched(
        self, stretch: AxialStretch, where: Callable[[Array], NDArray[np.bool_]] | None = None
    ) -> Inertia:
        """Compute the inertia of the stretched material; its density stays the same.

        The material is taken as the uniform box that has this inertia. That is exact where all
        of it is stretched: the second moment S of mass m becomes f A S Aᵀ, of mass f m, with
        A = 1 + (f - 1) u uᵀ.

        Args:
            stretch: What is done to the material.
            where: Tells at which points (K, 3) it is; ``None`` for everywhere.
        """
        points, weights = self._sample()
        chosen = np.ones(len(points), dtype=bool) if where is None else where(points)
        moved = np.where(chosen[:, None], stretch(points), points)
        weights = weights * np.where(chosen, stretch.growth(points), 1.0)
        mass = weights.sum()
        center = weights @ moved / mass
        away = moved - center
        return Inertia(float(mass), center, (weights[:, None] * away).T @ away)

    def _sample(self) -> tuple[Array, Array]:
        """Sample points (K, 3) of the uniform box with this inertia, and their masses (K,)."""
        spread, axes = np.linalg.eigh(self.spread)
        half = np.sqrt(3.0 * np.maximum(spread, 0.0) / self.mass)
        nodes, weights = _box_nodes()
        return self.center + (nodes * half) @ axes.T, self.mass * weights


@cache
def _box_nodes() -> tuple[Array, Array]:
    """Return points (K, 3) of the box [-1, 1]³ and weights (K,) that sum to 1."""
    nodes, weights = np.polynomial.legendre.leggauss(NODES)
    grid = np.stack(np.meshgrid(nodes, nodes, nodes, indexing="ij"), axis=-1).reshape(-1, 3)
    return grid, np.einsum("i,j,k->ijk", weights, weights, weights).ravel() / 8.0


class Skeleton(LinkFrames):
    """Parts of a compiled specification, with all joints at zero."""

    def __init__(
        self,
        spec: mujoco.MjSpec,
        *,
        torso: str,
        sole_sites: Collection[str],
        head_joints: Collection[str],
    ) -> None:
        self.spec, self.model = spec, spec.compile()
        super().__init__(mujoco.MjData(self.model))
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_comPos(self.model, self.data)
        self._soles = {self.model.site(name).id for name in sole_sites}
        self._bodies = {body.id: body for body in spec.bodies}
        self.parts = find_parts(self.model, torso, sole_sites, head_joints)

    @property
    def torso(self) -> Link:
        """Return the torso."""
        return self.parts.torso

    def root(self, link: Link) -> mujoco.MjsBody:
        """Return the body of a link that has the joints."""
        return self._bodies[link.root]

    def bodies(self, link: Link) -> list[mujoco.MjsBody]:
        """Return the bodies of a link, the one with the joints first."""
        return [self._bodies[body] for body in link.bodies]

    def has_sole(self, link: Link) -> bool:
        """Return whether a link is a foot."""
        return not self._soles.isdisjoint(link.sites)

    def sole(self, link: Link) -> Array:
        """Return the middle of a foot's soles, in its frame [m], (3,)."""
        soles = sorted(
            self._soles.intersection(link.sites), key=lambda site: self.model.site(site).name
        )
        away = [self.data.site_xpos[sole] - self.data.xpos[link.root] for sole in soles]
        return self.axes(link).T @ np.mean(away, axis=0)

    def bounds(self, link: Link, frame: Link) -> Array | None:
        """Return the box that holds a link's shapes, in the frame of another, (2, 3) [m]."""
        boxes = [self.bounds_of(geom, frame) for geom in link.geoms]
        if not boxes:
            return None
        corners = np.array(boxes)
        return np.array([corners[:, 0].min(axis=0), corners[:, 1].max(axis=0)])

    def bounds_of(self, geom: int, frame: Link) -> Array:
        """Return the box that holds a geom, in the frame of a link, (2, 3) [m]."""
        axes = self.axes(frame)
        own = axes.T @ self.data.geom_xmat[geom].reshape(3, 3)
        middle, half = self.model.geom_aabb[geom].reshape(2, 3)
        away = self.data.geom_xpos[geom] - self.data.xpos[frame.root]
        center = axes.T @ away + own @ middle
        reach = np.abs(own) @ half
        return np.array([center - reach, center + reach])


LEAST_HALF = 1e-4  # m; a capsule as short as this is a ball
QUATERNION = mujoco.mjtOrientation.mjORIENTATION_QUAT
FREE = mujoco.mjtJoint.mjJNT_FREE
SPHERE, CAPSULE, CYLINDER, BOX, ELLIPSOID, MESH = (
    mujoco.mjtGeom.mjGEOM_SPHERE,
    mujoco.mjtGeom.mjGEOM_CAPSULE,
    mujoco.mjtGeom.mjGEOM_CYLINDER,
    mujoco.mjtGeom.mjGEOM_BOX,
    mujoco.mjtGeom.mjGEOM_ELLIPSOID,
    mujoco.mjtGeom.mjGEOM_MESH,
)


def stretch_link(
    skeleton: Skeleton, link: Link, stretch: AxialStretch, kept: Collection[int] = ()
) -> None:
    """Stretch a link, in its frame, and all on it but for bodies that are kept; the frame stays."""
    model = skeleton.model
    for body in skeleton.bodies(link):
        local = stretch.seen_from(*skeleton.pose(body.id, link))
        shift = np.zeros(3) if body.id == link.root else local(np.zeros(3))
        stretch_inertia(body, local, shift)
        for geom in body.geoms:
            stretch_geom(skeleton, geom, local, shift)
        for site in body.sites:
            site.fromto = np.full(6, np.nan)
            at = local(model.site_pos[site.id]) - shift
            write_pose(site, body, at, model.site_quat[site.id])
        for camera in body.cameras:
            at = local(model.cam_pos[camera.id]) - shift
            write_pose(camera, body, at, model.cam_quat[camera.id])
        for light in body.lights:
            light.pos = local(model.light_pos[light.id]) - shift
            light.dir = model.light_dir[light.id]
            _leave_frame(light, body)
        for joint in body.joints:
            if joint.type != FREE:
                joint.pos = local(model.jnt_pos[joint.id]) - shift
                joint.axis = model.jnt_axis[joint.id]
                _leave_frame(joint, body)
        for child in body.bodies:
            at = model.body_pos[child.id]
            at = (at if child.id in kept else local(at)) - shift
            write_pose(child, body, at, model.body_quat[child.id])


def stretch_inertia(
    body: mujoco.MjsBody,
    stretch: AxialStretch,
    shift: Array | None = None,
    where: Callable[[Array], NDArray[np.bool_]] | None = None,
) -> None:
    """Stretch a body's mass, in its frame, where there is one and as `Inertia.stretched` does."""
    if body.mass <= 0.0:
        return
    axes = quaternion.to_matrix(body.iquat)
    inertia = Inertia.from_principal(body.mass, body.ipos, axes, body.inertia)
    stretched = inertia.stretched(stretch, where)
    body.mass, body.ipos = stretched.mass, stretched.center - (0.0 if shift is None else shift)
    body.inertia, body.iquat = stretched.principal()


def stretch_geom(
    skeleton: Skeleton, geom: mujoco.MjsGeom, stretch: AxialStretch, shift: Array | None = None
) -> None:
    """Stretch a shape, in the frame of its body; what is round stays as thick as it was.

    A box that lies obliquely stays a box: each of its edges becomes as long as it would.
    """
    model, i = skeleton.model, geom.id
    kind, size = mujoco.mjtGeom(int(model.geom_type[i])), model.geom_size[i].copy()
    center, quat = model.geom_pos[i].copy(), model.geom_quat[i].copy()
    axes = quaternion.to_matrix(quat)
    if kind in (CAPSULE, CYLINDER):
        cap = size[0] if kind == CAPSULE else 0.0
        center, half = stretch.extend(center, axes[:, 2] * (size[1] + cap))
        size[1] = max(float(np.linalg.norm(half)) - cap, LEAST_HALF)
    elif kind in (BOX, ELLIPSOID):
        ends = [stretch.extend(center, axes[:, k] * size[k]) for k in range(3)]
        longest = int(np.argmax(np.abs(stretch.direction @ axes)))
        center, size = ends[longest][0], np.linalg.norm([half for _, half in ends], axis=1)
    elif kind == SPHERE:
        center = stretch(center)
    elif kind == MESH:
        _stretch_mesh(skeleton, geom, axes, stretch)
        center, quat = np.zeros(3), quaternion.IDENTITY
    else:
        raise BodyError(
            f"shape '{geom.name}' is of kind {kind.name.removeprefix('mjGEOM_').lower()}, "
            "expected box, capsule, cylinder, ellipsoid, sphere or mesh to stretch it"
        )
    if kind != MESH:
        geom.type, geom.meshname = kind, ""
    geom.size, geom.fromto = size, np.full(6, np.nan)
    write_pose(geom, geom.parent, center - (0.0 if shift is None else shift), quat)


def _stretch_mesh(
    skeleton: Skeleton, geom: mujoco.MjsGeom, axes: Array, stretch: AxialStretch
) -> None:
    """Give a geom a stretched copy of its mesh, in its body's frame."""
    model, old = skeleton.model, skeleton.spec.mesh(geom.meshname)
    mesh = model.mesh(int(model.geom_dataid[geom.id]))
    first, face = int(mesh.vertadr[0]), int(mesh.faceadr[0])
    points = model.mesh_vert[first : first + int(mesh.vertnum[0])] @ axes.T
    points = stretch(points + model.geom_pos[geom.id])
    faces = model.mesh_face[face : face + int(mesh.facenum[0])]
    name = f"{old.name} of geom {geom.id}"
    skeleton.spec.add_mesh(
        name=name,
        uservert=points.ravel().tolist(),
        userface=faces.ravel().tolist(),
        inertia=old.inertia,
        maxhullvert=old.maxhullvert,
    )
    geom.meshname = name


def write_pose(
    element: mujoco.MjsBody | mujoco.MjsGeom | mujoco.MjsSite | mujoco.MjsCamera,
    body: mujoco.MjsBody,
    position: Array,
    quat: Array,
) -> None:
    """Write the pose of an element on a body, in the body's frame."""
    element.pos, element.quat, element.alt.type = position, quat, QUATERNION
    _leave_frame(element, body)


def _leave_frame(element: Any, body: mujoco.MjsBody) -> None:
    """Take an element out of its frame, which its pose now contains."""
    if element.frame is not None:
        element.set_frame(body.frames[-1])
