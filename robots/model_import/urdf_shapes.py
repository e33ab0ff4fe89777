"""Shapes of a URDF: meshes are found and converted to hulls, with visual shapes as a fallback."""

from __future__ import annotations

import re
import struct
import warnings
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np

from robots.body.shapes import find_hull
from robots.quaternion import Array
from robots.storage.files import check_file, describe, read_bounded
from robots.storage.model_files import MAX_ASSET, MAX_ASSETS, POINTER_PROBLEM, is_pointer, parse_xml
from robots.storage.validation import shown

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
    """Read a mesh file; return its convex hull as a binary STL file."""
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
    hull = find_hull(points)
    if hull is None:
        normal = np.linalg.svd(points - points.mean(axis=0))[2][2]  # of points in a plane
        hull = find_hull(np.concatenate([points - THIN * normal, points + THIN * normal]))
    if hull is None:
        raise ValueError("it holds no solid: all of it is in one line or place")
    faces = hull.points[hull.simplices]  # (f, 3, 3)
    inwards = np.cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0])
    flipped = np.sum(inwards * hull.equations[:, :3], axis=1) < 0.0
    faces[flipped] = faces[flipped][:, ::-1]
    rows = np.zeros((len(faces), FACE), dtype=np.uint8)
    rows[:, 12:48] = faces.reshape(-1, 9).astype("<f4").view(np.uint8)
    return bytes(HEAD - 4) + struct.pack("<I", len(faces)) + rows.tobytes()


NOT_FOUND = "is not found, expected it beside the model, or in a folder above"
MOST_NAMED = 3  # meshes that are not found
KINDS, SIZES = ("sphere", "cylinder", "capsule", "box"), ("radius", "length", "size")


class UrdfShapes:
    """Chooses and resolves the shapes of a URDF's links, in place."""

    def __init__(self, path: Path, root: ET.Element, notes: list[str]) -> None:
        self._path, self._root, self._notes = path, root, notes
        self._converted: dict[Path, str] = {}
        self._bytes = 0
        self._pointer = ""
        self.hulls: dict[str, bytes] = {}
        """Files converted from meshes that MuJoCo does not read, by name."""
        self.flat: dict[str, str] = {}
        """Shapes without extent, which were left out, by the name of their link."""

    def resolve(self) -> list[str]:
        """Replace the names of meshes by files that MuJoCo reads; return problems.

        A link keeps its collision shapes, or its visual ones if it has no others, or if meshes can
        be read of the visual ones only.
        """
        problems: list[str] = []
        for link in self._root.findall("link"):
            self._drop_empty(link)
            solid, seen = link.findall("collision"), link.findall("visual")
            troubles = [*self._find_troubles(link, solid or seen)]
            if troubles and solid and seen and not [*self._find_troubles(link, seen)]:
                self._notes.append(
                    f"link {link.get('name')}: its visual shapes are used, "
                    f"as {troubles[0].partition(': ')[2]}"
                )
                solid, seen, troubles = seen, solid, []
            for other in seen if solid else ():
                link.remove(other)
            problems += troubles
            for mesh in () if troubles else link.iter("mesh"):
                if file := find_mesh(self._path, mesh.get("filename", "")):
                    mesh.set("filename", self._converted[file])
        return self._count_lost(list(dict.fromkeys(problems)))

    def _count_lost(self, problems: list[str]) -> list[str]:
        """Name the first meshes that are not found, and count the others."""
        further = [text for text in problems if text.endswith(NOT_FOUND)][MOST_NAMED:]
        if not further:
            return problems
        count = f"{self._path}: {len(further)} further meshes are not found"
        return [text for text in problems if text not in further] + [count]

    def _drop_empty(self, link: ET.Element) -> None:
        for shape in [*link.findall("collision"), *link.findall("visual")]:
            sizes = [
                (part.tag, key, part.get(key, ""))
                for kind in KINDS
                for part in shape.iter(kind)
                for key in SIZES
            ]
            flat = [each for each in sizes if any(float(word) <= 0.0 for word in each[2].split())]
            if flat:
                link.remove(shape)
                kind, key, given = flat[0]
                text = f"a {kind} of {key} {given} is left out, expected more than 0"
                self._notes.append(f"link {link.get('name')}: {text}")
                self.flat[link.get("name", "")] = text

    def _find_troubles(self, link: ET.Element, shapes: Iterable[ET.Element]) -> Iterator[str]:
        for mesh in (mesh for shape in shapes for mesh in shape.iter("mesh")):
            name = mesh.get("filename", "")
            where = f"{self._path}: mesh {shown(name)} of link {shown(link.get('name'))}"
            file = find_mesh(self._path, name)
            if file is None:
                yield f"{where} {NOT_FOUND}"
            elif file.suffix.lower() not in MESH_KINDS:
                yield f"{where} is of kind {shown(file.suffix)}, expected {', '.join(MESH_KINDS)}"
            else:
                try:
                    if is_pointer(file):
                        self._pointer = self._pointer or name  # the first stands for all
                        yield f"{self._path}: mesh {shown(self._pointer)} {POINTER_PROBLEM}"
                    else:
                        self._convert(file)
                except (OSError, ValueError) as error:
                    reason = describe(error)
                    yield f"{where} cannot be read ({reason}), expected {', '.join(MESH_KINDS)}"

    def _convert(self, file: Path) -> None:
        if file not in self._converted:
            self._bytes += check_file(file, MAX_ASSET)
            if self._bytes > MAX_ASSETS:
                raise ValueError(f"with it all meshes have {self._bytes} bytes")
            name = str(file)
            if not is_readable(file):
                name = f"hull_{len(self.hulls)}.stl"
                self.hulls[name] = read_hull(file)
            self._converted[file] = name


def find_mesh(path: Path, name: str) -> Path | None:
    """Find a mesh by its name in a URDF: a path, file://..., or package://NAME/...

    Folders above the model are searched, too, and a file whose name differs by case is taken.
    """
    plain = name.removeprefix("file://")
    parts = Path(plain.removeprefix("package://")).parts
    above = path.resolve().parents
    places = [path.parent / plain, *(up.joinpath(*parts) for up in above)]
    places += [up.joinpath(*parts[1:]) for up in above if len(parts) > 1]
    try:
        found = [place for place in places if place.is_file()]
        found = found or [file for place in places for file in _ignore_case(place)]
        return found[0].resolve() if found else None
    except OSError:  # a name too long, or a folder that may not be read
        return None


def _ignore_case(place: Path) -> list[Path]:
    if not place.name or not place.parent.is_dir():
        return []
    name = place.name.lower()
    return [f for f in place.parent.iterdir() if f.name.lower() == name and not f.is_dir()]
