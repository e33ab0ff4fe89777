"""Shapes of a URDF: meshes are found and converted, with visual shapes as a fallback."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterable, Iterator
from pathlib import Path

from robots.model_import.mesh_files import MESH_KINDS, is_readable, read_hull
from robots.storage.files import check_file, describe
from robots.storage.model_files import (
    MAX_ASSET,
    MAX_ASSETS,
    POINTER_PROBLEM,
    is_pointer,
)
from robots.storage.validation import shown

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
                self._resolve(mesh)
        return self._count_lost(list(dict.fromkeys(problems)))

    def _count_lost(self, problems: list[str]) -> list[str]:
        """Name the first meshes that are not found, and count the others."""
        further = [text for text in problems if text.endswith(NOT_FOUND)][MOST_NAMED:]
        if not further:
            return problems
        count = f"{self._path}: {len(further)} further meshes are not found"
        return [text for text in problems if text not in further] + [count]

    def _drop_empty(self, link: ET.Element) -> None:
        """Drop shapes without extent."""
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

    def _resolve(self, mesh: ET.Element) -> None:
        file = find_mesh(self._path, mesh.get("filename", ""))
        if file is not None:
            mesh.set("filename", self._converted[file])


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
