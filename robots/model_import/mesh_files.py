"""Mesh files that MuJoCo does not read, as convex hulls: COLLADA and text STL."""

from __future__ import annotations

import re
import struct
import warnings
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from robots.quaternion import Array
from robots.storage.files import read_bounded
from robots.storage.model_files import MAX_ASSET, parse_xml

READ_BY_MUJOCO = (".stl", ".obj", ".msh")
MESH_KINDS = (*READ_BY_MUJOCO, ".dae")
MAX_FACES = 200_000  # that MuJoCo reads from an STL file
MOST_POINTS = 300_000  # of which a hull is made in some seconds, even if all are on it
FACE = 50  # bytes of a face of a binary STL file, after a head of HEAD
HEAD = 84
VERTEX = re.compile(rb"vertex\s+(\S+)\s+(\S+)\s+(\S+)")
TRANSFORMS = {"matrix": 16, "translate": 3, "scale": 3, "rotate": 4}
"""Count of numbers in each element that moves a node of COLLADA."""
DEEPEST = 200  # nodes in each other
Y_TO_Z = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
NO_AXIS = 1e-12  # length of an axis about which nothing turns
FARTHEST = 1e6  # m; a number beyond is an error, or none
THIN = 1e-4  # m; points within a plane are given that thickness


def is_readable(path: Path) -> bool:
    """Tell whether MuJoCo reads a mesh file itself."""
    if path.suffix.lower() != ".stl":
        return path.suffix.lower() in READ_BY_MUJOCO
    with path.open("rb") as file:
        head = file.read(HEAD)
    if len(head) < HEAD:
        return False
    count = struct.unpack("<I", head[80:HEAD])[0]
    return path.stat().st_size == HEAD + FACE * count and 0 < count <= MAX_FACES


def read_hull(path: Path) -> bytes:
    """Read a mesh file; return its convex hull as a binary STL file.

    Raises:
        OSError: if it cannot be read.
        ValueError: if it holds no points.
    """
    content = read_bounded(path, MAX_ASSET)
    points = _read_collada(content) if path.suffix.lower() == ".dae" else _read_stl(content)
    if len(points) < 4 or not np.all(np.abs(points) < FARTHEST):
        raise ValueError("it holds no solid")
    if len(points) > MOST_POINTS:
        points = np.unique(points, axis=0)
    if len(points) > MOST_POINTS:
        raise ValueError(f"it has {len(points)} corners, expected at most {MOST_POINTS}")
    return _write_stl(points)


def _read_stl(content: bytes) -> Array:
    found = VERTEX.findall(content)
    if found:
        return np.array(found, dtype=float).reshape(-1, 3)
    faces = np.frombuffer(content[HEAD : HEAD + (len(content) - HEAD) // FACE * FACE], np.uint8)
    corners = faces.reshape(-1, FACE)[:, 12:48].copy().view("<f4")  # after each face's normal
    return corners.reshape(-1, 3).astype(float)


def _read_collada(content: bytes) -> Array:
    """Read the points of a COLLADA scene [m], z up, (p, 3)."""
    root = parse_xml(content)
    for element in root.iter():
        element.tag = element.tag.rpartition("}")[2]
    unit = root.find("asset/unit")
    scale = 1.0 if unit is None else float(unit.get("meter", "1"))
    shapes = {
        geometry.get("id", ""): _read_positions(geometry)
        for geometry in root.findall("library_geometries/geometry")
    }
    points = [
        part
        for scene in root.findall("library_visual_scenes/visual_scene")
        for node in scene.findall("node")
        for part in _walk(node, np.eye(4), shapes, DEEPEST)
    ]
    parts = points or list(shapes.values())
    whole = scale * np.concatenate([np.zeros((0, 3)), *parts])
    is_y_up = root.findtext("asset/up_axis", "").strip() == "Y_UP"
    return whole @ Y_TO_Z.T if is_y_up else whole


def _read_positions(geometry: ET.Element) -> Array:
    """Read the positions of a geometry's vertices, (p, 3)."""
    names = {
        i.get("source", "")[1:] for i in geometry.iter("input") if i.get("semantic") == "POSITION"
    }
    arrays = [
        _read_numbers(source.findtext("float_array"))
        for source in geometry.iter("source")
        if source.get("id") in names
    ]
    return np.concatenate([np.zeros(0), *arrays]).reshape(-1, 3)


def _walk(node: ET.Element, above: Array, shapes: dict[str, Array], levels: int) -> list[Array]:
    """Collect the points of a node and of its descendants up to a depth, in the scene's frame."""
    if not levels:
        raise ValueError("its nodes are nested too deep")
    pose = above @ _read_pose(node)
    found = [
        shapes[name] @ pose[:3, :3].T + pose[:3, 3]
        for instance in node.findall("instance_geometry")
        if (name := instance.get("url", "")[1:]) in shapes
    ]
    for child in node.findall("node"):
        found += _walk(child, pose, shapes, levels - 1)
    return found


def _read_pose(node: ET.Element) -> Array:
    pose = np.eye(4)
    for element in node:
        step = np.eye(4)
        if element.tag not in TRANSFORMS:
            continue
        values = _read_numbers(element.text)
        if len(values) != TRANSFORMS[element.tag]:
            raise ValueError(f"<{element.tag}> has {len(values)} numbers")
        if element.tag == "matrix":
            step = values.reshape(4, 4)
        elif element.tag == "translate":
            step[:3, 3] = values
        elif element.tag == "scale":
            step[:3, :3] = np.diag(values)
        else:
            step[:3, :3] = _turn(values[:3], np.radians(values[3]))
        pose = pose @ step
    return pose


def _read_numbers(text: str | None) -> Array:
    """Read numbers between spaces, (n,), with little more memory than the text takes."""
    with warnings.catch_warnings():
        warnings.simplefilter("error", DeprecationWarning)
        try:
            return np.fromstring(text or "", sep=" ")
        except DeprecationWarning as error:
            raise ValueError("it has a text where numbers are expected") from error


def _turn(axis: Array, angle: float) -> Array:
    x, y, z = axis / max(float(np.linalg.norm(axis)), NO_AXIS)
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross


def _write_stl(points: Array) -> bytes:
    try:
        hull = ConvexHull(points)
    except QhullError:
        try:
            hull = ConvexHull(_thicken(points))
        except QhullError as error:
            raise ValueError("it holds no solid: all of it is in one line or place") from error
    faces = hull.points[hull.simplices]  # (f, 3, 3)
    inwards = np.cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0])
    flipped = np.sum(inwards * hull.equations[:, :3], axis=1) < 0.0
    faces[flipped] = faces[flipped][:, ::-1]
    rows = np.zeros((len(faces), FACE), dtype=np.uint8)
    rows[:, 12:48] = faces.reshape(-1, 9).astype("<f4").view(np.uint8)
    return bytes(HEAD - 4) + struct.pack("<I", len(faces)) + rows.tobytes()


def _thicken(points: Array) -> Array:
    normal = np.linalg.svd(points - points.mean(axis=0))[2][2]
    return np.concatenate([points - THIN * normal, points + THIN * normal])
