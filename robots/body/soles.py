"""Soles: the flat faces on which a robot's feet stand."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from robots import quaternion
from robots.body.shapes import find_hull, sample_shapes
from robots.kinematics import place
from robots.quaternion import Array
from robots.robot import Robot

FLAT = 0.0025  # m off a plane that still belong to a sole: treads and studs
STEEP = np.cos(np.radians(50.0))
LARGE = 0.3  # share of a sole's outline from which a face of it is the one to stand on
ON_GROUND = 0.004  # m above the lowest point that still belong to a sole


@dataclass(frozen=True, eq=False)
class Sole:
    """The flat face of a foot, in the frame of its body."""

    body: int
    position: Array
    """Middle of the face [m], (3,)."""
    axes: Array
    """Forward, left and up of the face, in columns, (3, 3)."""
    area: float
    """[m²]"""


def find_sole(
    model: mujoco.MjModel, data: mujoco.MjData, body: int, least_area: float
) -> Sole | None:
    """Find the largest flat face of a body that faces down in a pose, of an area [m²] or more.

    The model is a rebuilt one: x forward, z up.
    """
    best: Sole | None = None
    rotation = data.xmat[body].reshape(3, 3)
    points = sample_shapes(model, body)
    for normal, on_it in _list_faces(points, rotation.T @ np.array([0.0, 0.0, -1.0])):
        area = _measure_area(normal, on_it)
        if area > (best.area if best else least_area):
            best = _describe(body, points, normal, on_it, rotation, area)
    return best


def find_lowest(model: mujoco.MjModel, data: mujoco.MjData, body: int) -> float:
    """Return the height of the lowest point of a body's shapes [m]; infinite without shapes."""
    up = data.xmat[body].reshape(3, 3)[2]
    return float(data.xpos[body, 2] + np.min(sample_shapes(model, body) @ up, initial=np.inf))


def _list_faces(points: Array, down: Array) -> list[tuple[Array, Array]]:
    """List normal and points of the flat faces of the points' hull that face down, (3,)."""
    hull = find_hull(points)
    if hull is None:
        return []
    faces = []
    for equation in np.unique(hull.equations.round(4), axis=0):  # a face is made of triangles
        normal, offset = equation[:3], equation[3]
        if normal @ down > STEEP:
            on_it = np.abs(points @ normal + offset) < FLAT
            faces.append((normal, points[on_it]))
    return faces


def _measure_area(normal: Array, points: Array) -> float:
    return _measure_outline(points @ np.linalg.svd(normal[None])[2][1:].T)


def _measure_outline(points: Array) -> float:
    """Measure the area that points (p, 2) enclose [m²]."""
    hull = find_hull(points)
    return 0.0 if hull is None else float(hull.volume)  # of points in a plane, the area


def _describe(
    body: int, points: Array, normal: Array, on_it: Array, rotation: Array, area: float
) -> Sole:
    up: Array = -normal
    forward = rotation.T @ np.array([1.0, 0.0, 0.0])
    forward = forward - up * (forward @ up)
    forward /= np.linalg.norm(forward)
    axes = np.column_stack([forward, np.cross(up, forward), up])
    own = on_it @ axes
    middle = (own.min(axis=0) + own.max(axis=0)) / 2.0
    middle[2] = np.min(points @ up)  # where the lowest point touches the ground
    return Sole(body, axes @ middle, axes, area)


def add_sole_site(spec: mujoco.MjSpec, body: str, sole: Sole, name: str) -> None:
    """Add the site of a sole to a model."""
    spec.body(body).add_site(
        name=name,
        pos=sole.position.tolist(),
        quat=quaternion.normalize(quaternion.from_matrix(sole.axes)).tolist(),
        size=[0.005, 0, 0],
    )


def list_sole_points(model: mujoco.MjModel, site: str) -> Array:
    """List points that span the shapes of the foot that a site is on, in its frame, (p, 3) [m]."""
    number = model.site(site).id
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    foot = model.body_weldid[model.site_bodyid[number]]
    points = [
        data.xpos[body] + sample_shapes(model, int(body)) @ data.xmat[body].reshape(3, 3).T
        for body in np.flatnonzero(model.body_weldid == foot)
    ]
    axes = data.site_xmat[number].reshape(3, 3)
    return (np.concatenate(points) - data.site_xpos[number]) @ axes


def measure_tilt(points: Array) -> float:
    """Measure the angle between z and the largest face of points (p, 3) that faces down [rad].

    It is 0 for a round foot, which has no such face.
    """
    faces = _list_faces(points, np.array([0.0, 0.0, -1.0]))
    largest = max(faces, key=lambda face: _measure_area(*face), default=None)
    if largest is None or _measure_area(*largest) < LARGE * _measure_outline(points[:, :2]):
        return 0.0
    return float(np.arccos(np.clip(-largest[0][2], -1.0, 1.0)))


def measure_support_margin(robot: Robot, model: mujoco.MjModel) -> float:
    """Measure how far the center of mass is inside the edge of the soles in the stance [m].

    It is negative outside, and minus infinity for soles without area on the ground.
    """
    data = mujoco.MjData(model)
    data.qpos[:] = place(robot, model, robot.standing)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    center = data.subtree_com[robot.layout(model).torso][:2]
    points = np.concatenate([_place_sole(model, data, site) for site in robot.sole_sites])
    points = points[points[:, 2] < points[:, 2].min() + ON_GROUND][:, :2]
    hull = find_hull(points)
    if hull is None:
        return -np.inf
    edges = hull.equations  # outward normals and offsets
    return float(-np.max(edges[:, :2] @ center + edges[:, 2]))


def _place_sole(model: mujoco.MjModel, data: mujoco.MjData, site: str) -> Array:
    number = model.site(site).id
    axes = data.site_xmat[number].reshape(3, 3)
    return data.site_xpos[number] + list_sole_points(model, site) @ axes.T
