"""Shapes of a model as primitives; meshes are fitted by primitives or kept as hulls."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import product

import mujoco
import numpy as np
import scipy  # which imports its parts when they are used

from robots import quaternion
from robots.quaternion import Array

GEOM = mujoco.mjtGeom
PRIMITIVES = (
    GEOM.mjGEOM_SPHERE,
    GEOM.mjGEOM_CAPSULE,
    GEOM.mjGEOM_ELLIPSOID,
    GEOM.mjGEOM_CYLINDER,
    GEOM.mjGEOM_BOX,
)
ROUND = 1.1  # a capsule is taken where its volume is at most so many times the box's
SLENDER = 1.6  # length over width from which a capsule is tried
TURNS = np.radians(np.arange(0.0, 90.0, 5.0))  # about each axis, at which boxes are tried
UPRIGHT = 1.05  # times the smallest volume that a box along the points' frame may have: it reads
LARGE_FACE = 0.2  # of a hull's surface, from which a box lies flush with its largest flat face
FLUSH = 1.5  # times the smallest volume that such a box may have
PARALLEL = np.cos(np.radians(2.0))  # least cosine between normals of one face
COPLANAR = 0.0015  # m; triangles so near to one plane, and parallel to it, are of one face
LEAST_SIZE = 5e-4  # m, half of the thinnest sheet
HULL_POINTS = 48
DIRECTIONS = np.array([way for way in product((-1.0, 0.0, 1.0), repeat=3) if any(way)])


@dataclass(frozen=True, eq=False)
class Shape:
    """A shape in the frame of its body."""

    kind: int
    """An ``mjtGeom``."""
    size: Array
    """As of a geom of MuJoCo, (3,) [m]."""
    position: Array
    """[m], (3,)"""
    orientation: Array
    """w x y z, (4,)"""
    points: Array | None = None
    """Corners of a convex hull in the shape's frame [m], (p, 3)."""

    def sample(self) -> Array:
        """Return points on its surface that span it, in the body's frame [m], (p, 3)."""
        return self.position + quaternion.rotate(self.orientation, self._sample_own())

    def _sample_own(self) -> Array:
        if self.points is not None:
            return self.points
        ball = DIRECTIONS / np.linalg.norm(DIRECTIONS, axis=1, keepdims=True)
        corners = DIRECTIONS[np.abs(DIRECTIONS).sum(axis=1) == 3.0]
        radius, half = self.size[0], self.size[1]
        if self.kind == GEOM.mjGEOM_SPHERE:
            return radius * ball
        if self.kind == GEOM.mjGEOM_ELLIPSOID:
            return self.size * ball
        if self.kind == GEOM.mjGEOM_BOX:
            return self.size * corners
        ends = np.array([[0.0, 0.0, half], [0.0, 0.0, -half]])
        if self.kind == GEOM.mjGEOM_CAPSULE:
            return np.concatenate([end + radius * ball for end in ends])
        angle = np.linspace(0.0, 2.0 * np.pi, 16, endpoint=False)
        rim = radius * np.column_stack([np.cos(angle), np.sin(angle), np.zeros(16)])
        return np.concatenate([end + rim for end in ends])


def read_shapes(
    model: mujoco.MjModel, body: int, *, keep_hulls: bool, solid: bool = False
) -> list[Shape]:
    """Read the collision shapes of a body or, unless ``solid``, visual ones if it has no others.

    Meshes become their convex hulls, if kept, or boxes and capsules.
    """
    geoms = list_solid(model, body) or ([] if solid else _list_geoms(model, body))
    shapes = [_read_shape(model, geom, keep_hulls) for geom in geoms]
    return [shape for shape in shapes if shape is not None]


def list_solid(model: mujoco.MjModel, body: int) -> list[int]:
    """List the geoms of a body that collide."""
    geoms = _list_geoms(model, body)
    return [g for g in geoms if model.geom_contype[g] or model.geom_conaffinity[g]]


def _list_geoms(model: mujoco.MjModel, body: int) -> list[int]:
    first = int(model.body_geomadr[body])
    return list(range(first, first + int(model.body_geomnum[body])))


def sample_shapes(model: mujoco.MjModel, body: int) -> Array:
    """Return points that span a body's shapes, in its frame [m], (p, 3)."""
    shapes = read_shapes(model, body, keep_hulls=True)
    return np.concatenate([np.zeros((0, 3)), *(shape.sample() for shape in shapes)])


def _read_shape(model: mujoco.MjModel, geom: int, keep_hulls: bool) -> Shape | None:
    kind = int(model.geom_type[geom])
    position, orientation = model.geom_pos[geom].copy(), model.geom_quat[geom].copy()
    if kind in PRIMITIVES:
        size = np.maximum(model.geom_size[geom], 0.0)
        return Shape(kind, size.copy(), position, orientation)
    if kind != GEOM.mjGEOM_MESH:
        return None  # a plane or a height field is scenery
    mesh = int(model.geom_dataid[geom])
    first, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
    vertices = model.mesh_vert[first : first + count].astype(float)
    shape = _hull(vertices) if keep_hulls else fit_shape(vertices)
    return replace(
        shape,
        position=position + quaternion.rotate(orientation, shape.position),
        orientation=quaternion.multiply(orientation, shape.orientation),
    )


def fit_shape(points: Array) -> Shape:
    """Fit the smallest box that holds points, or a capsule where it holds them as tightly.

    Boxes along the axes of the points' frame, turned about one of them, and along their
    principal axes are tried. Where the points have a large flat face, such as a sole, a box that
    lies flush with it is taken, even if it is larger.
    """
    points = _corners(points)
    frames = [np.eye(3), np.linalg.svd(points - points.mean(axis=0))[2].T]
    for base in list(frames):
        frames += [base @ _turn(axis, angle) for axis in range(3) for angle in TURNS[1:]]
    box = _choose_box(points, frames)
    normal = _find_large_face(points)
    if normal is not None:
        base = _make_frame(normal)
        flush = _choose_box(points, [base, *(base @ _turn(2, angle) for angle in TURNS[1:])])
        if np.prod(flush.size) < FLUSH * np.prod(box.size):
            box = flush
    capsule = _capsule(points, box)
    return box if capsule is None else capsule


def _choose_box(points: Array, frames: list[Array]) -> Shape:
    """Fit boxes along frames; return the first, if it is about as small as the smallest."""
    boxes = [_box(points, frame if np.linalg.det(frame) > 0 else -frame) for frame in frames]
    best = min(boxes, key=lambda box: np.prod(box.size))
    is_upright = np.prod(boxes[0].size) < UPRIGHT * np.prod(best.size)
    return boxes[0] if is_upright else best


def _find_large_face(points: Array) -> Array | None:
    """Find the normal of the largest flat face of the points' hull, (3,); None if it is small."""
    hull = find_hull(points)
    if hull is None:
        return None
    first, second, third = (hull.points[hull.simplices[:, k]] for k in range(3))
    areas = 0.5 * np.linalg.norm(np.cross(second - first, third - first), axis=1)
    normals, offsets = hull.equations[:, :3], hull.equations[:, 3]
    is_one = (normals @ normals.T > PARALLEL) & (np.abs(offsets - offsets[:, None]) < COPLANAR)
    total = is_one @ areas
    face = is_one[int(np.argmax(total))]
    normal = areas[face] @ normals[face]
    return normal if total.max() > LARGE_FACE * areas.sum() else None


def _make_frame(normal: Array) -> Array:
    """Make a frame whose third axis is a normal, near the axes of the points' frame, (3, 3)."""
    up = normal / np.linalg.norm(normal)
    nearest = np.eye(3)[np.argsort(np.abs(up))[0]]
    side = np.cross(up, nearest)
    side /= np.linalg.norm(side)
    return np.column_stack([np.cross(side, up), side, up])


def find_hull(points: Array) -> scipy.spatial.ConvexHull | None:
    """Find the convex hull of points (p, d); None if they are flat, or none."""
    try:
        return scipy.spatial.ConvexHull(points) if len(points) else None
    except scipy.spatial.QhullError:
        return None


def _corners(points: Array) -> Array:
    hull = find_hull(points)
    return points if hull is None else points[hull.vertices]


def _turn(axis: int, angle: float) -> Array:
    return quaternion.to_matrix(quaternion.from_axis_angle(np.eye(3)[axis], angle))


def _box(points: Array, frame: Array) -> Shape:
    own = points @ frame
    low, high = own.min(axis=0), own.max(axis=0)
    size, middle = np.maximum((high - low) / 2.0, LEAST_SIZE), frame @ ((low + high) / 2.0)
    return Shape(int(GEOM.mjGEOM_BOX), size, middle, quaternion.from_matrix(frame))


def _capsule(points: Array, box: Shape) -> Shape | None:
    """Return a capsule along a box if it holds the points as tightly, else None."""
    order = np.argsort(box.size)
    if box.size[order[2]] < SLENDER * box.size[order[1]]:
        return None
    frame = quaternion.to_matrix(box.orientation)[:, order]
    if np.linalg.det(frame) < 0.0:
        frame[:, 0] *= -1.0
    own = (points - box.position) @ frame
    off_axis = np.linalg.norm(own[:, :2], axis=1)
    radius = max(float(off_axis.max()), LEAST_SIZE)
    half = float(np.max(np.abs(own[:, 2]) - np.sqrt(np.maximum(radius**2 - off_axis**2, 0.0))))
    half = max(half, LEAST_SIZE)
    volume = np.pi * radius**2 * (2.0 * half + 4.0 / 3.0 * radius)
    if volume > ROUND * 8.0 * np.prod(box.size):
        return None
    size = np.array([radius, half, 0.0])
    return Shape(int(GEOM.mjGEOM_CAPSULE), size, box.position, quaternion.from_matrix(frame))


def _hull(points: Array) -> Shape:
    """Keep the corners of a hull that reach farthest, spread over its surface."""
    corners = _corners(points)
    chosen = [int(np.argmax(np.linalg.norm(corners - corners.mean(axis=0), axis=1)))]
    away = np.linalg.norm(corners - corners[chosen[0]], axis=1)
    while len(chosen) < min(HULL_POINTS, len(corners)):
        chosen.append(int(np.argmax(away)))
        away = np.minimum(away, np.linalg.norm(corners - corners[chosen[-1]], axis=1))
    kept = corners[chosen]
    if find_hull(kept) is None:
        return fit_shape(points)
    origin = np.zeros(3)
    return Shape(int(GEOM.mjGEOM_MESH), origin, origin, quaternion.IDENTITY, points=kept)
