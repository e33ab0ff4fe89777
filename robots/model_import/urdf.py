"""URDF files: a model with its meshes, the limits of its motors, and its ties."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import mujoco
import numpy as np

from robots.model_import.rebuild import LEAST_INERTIA, LEAST_MASS
from robots.model_import.source import (
    MOST_INERTIA,
    ActuatorFigures,
    ModelImportError,
    ModelSource,
    Tie,
    check_size,
    compile_spec,
    find_range_problems,
)
from robots.model_import.urdf_shapes import UrdfShapes
from robots.storage.files import describe
from robots.storage.model_files import MODEL_ERRORS
from robots.storage.validation import shown

IN_RADIANS = "limits of a URDF are in rad"
INERTIA = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
COUNTS = {
    "origin": {"xyz": 3, "rpy": 3},
    "axis": {"xyz": 3},
    "mass": {"value": 1},
    "inertia": dict.fromkeys(INERTIA, 1),
    "limit": {"lower": 1, "upper": 1, "effort": 1, "velocity": 1},
    "mimic": {"multiplier": 1, "offset": 1},
    "box": {"size": 3},
    "sphere": {"radius": 1},
    "cylinder": {"radius": 1, "length": 1},
    "capsule": {"radius": 1, "length": 1},
    "mesh": {"scale": 3},
}
"""Count of numbers in the attributes of an element."""


def read_number(element: ET.Element | None, key: str, default: float = 0.0) -> float:
    """Return the number of a checked attribute, or a default."""
    return default if element is None else float(element.get(key, default))


def find_value_problems(root: ET.Element) -> list[str]:
    """Find names that stand twice, texts that are not numbers, and impossible numbers."""
    problems = []
    for kind in ("link", "joint"):
        names = Counter(owner.get("name") for owner in root.findall(kind))
        problems += [
            f"{count} {kind}s are named {shown(name)}, expected a name of its own for each"
            for name, count in names.items()
            if name and count > 1
        ]
        for number, owner in enumerate(root.findall(kind), start=1):
            name = owner.get("name")
            where = f"{kind} {shown(name) if name else f'number {number}'}"
            unread = [f"{where}: {text}" for text in _find_unread(owner)]
            problems += unread or [f"{where} {text}" for text in _find_impossible(owner, root)]
    return problems


def _find_unread(owner: ET.Element) -> Iterator[str]:
    """Find attributes that do not hold the expected finite numbers."""
    for element in owner.iter():
        for key, count in COUNTS.get(element.tag, {}).items():
            text = element.get(key)
            if text is not None and not _holds(text, count):
                what = "a finite number" if count == 1 else f"{count} finite numbers"
                yield f"{key} of <{element.tag}> is {shown(text)}, expected {what}"


def _holds(text: str, count: int) -> bool:
    """Tell whether MuJoCo would read the expected count of finite numbers in a text."""
    try:
        numbers = [float(word) for word in text.split()]
    except ValueError:
        return False
    is_plain = text.isascii() and "_" not in text
    return is_plain and len(numbers) == count and all(map(math.isfinite, numbers))


def _find_impossible(owner: ET.Element, root: ET.Element) -> Iterator[str]:
    """Find values that no link or joint can have."""
    mass, limit, mimic = owner.find("inertial/mass"), owner.find("limit"), owner.find("mimic")
    if (heavy := read_number(mass, "value")) < 0.0:
        yield f"has a mass of {heavy:g} kg, expected 0 kg or more"
    for key in INERTIA:
        moment = read_number(owner.find("inertial/inertia"), key)
        if abs(moment) > MOST_INERTIA:
            yield f"has {key} of {moment:g} kg·m², expected at most {MOST_INERTIA:g} kg·m²"
    for key, unit in (("effort", "N·m"), ("velocity", "rad/s")):
        if (most := read_number(limit, key)) < 0.0:
            yield f"has a limit of {key} of {most:g} {unit}, expected 0 {unit} or more"
    if owner.get("type") == "revolute":
        lower, upper = read_number(limit, "lower"), read_number(limit, "upper")
        yield from find_range_problems(lower, upper, IN_RADIANS)
    if mimic is not None:
        others = [joint.get("name") for joint in root.findall("joint") if joint is not owner]
        if mimic.get("joint") not in others:
            yield (
                f"mimics {shown(mimic.get('joint'))}, expected another joint: "
                f"{', '.join(name for name in others if name)}"
            )


def find_tree_problems(root: ET.Element) -> Iterator[str]:
    """Find joints that do not make a tree of the links: of unknown links, or in a loop."""
    links = {link.get("name", ""): list[str]() for link in root.findall("link")}
    below: dict[str, list[str]] = {name: [] for name in links}
    for number, joint in enumerate(root.findall("joint"), start=1):
        name = shown(joint.get("name")) if joint.get("name") else f"number {number}"
        ends = [joint.find(end) for end in ("parent", "child")]
        parent, child = ("" if end is None else end.get("link", "") for end in ends)
        if not {parent, child} <= links.keys():
            yield f"joint {name} joins {shown(parent)} and {shown(child)}, expected two links"
            continue
        links[child].append(name)
        below[parent].append(child)
    for link, joints in links.items():
        if len(joints) > 1:
            yield (
                f"link {shown(link)} hangs on joints {' and '.join(joints)}, expected one: open "
                "the loop that they close"
            )
    reached = [link for link, joints in links.items() if not joints]
    for link in reached:  # which grows
        reached += [child for child in below[link] if child not in reached]
    if lost := [link for link in links if link not in reached]:
        yield (
            f"links {', '.join(map(shown, lost))} hang on each other in a loop, expected a torso "
            "that hangs on none: remove a joint between them"
        )


LEAST_MOMENT = 1e-12  # kg·m²; MuJoCo accepts it as positive
WATER = 1000.0  # kg/m³
MOVING = ("revolute", "continuous", "prismatic")


def read_urdf(path: Path, root: ET.Element) -> ModelSource:
    """Read a URDF file with a root element, which is changed."""
    check_size(path, links=len(root.findall("link")), joints=len(root.findall("joint")))
    notes: list[str] = []
    shapes = UrdfShapes(path, root, notes)
    problems = find_value_problems(root) or [*find_tree_problems(root)]
    problems = [f"{path}: {problem}" for problem in problems]
    problems += [] if problems else shapes.resolve()
    if problems:
        raise ModelImportError(*problems)
    _give_mass(root, notes)
    _mend_inertia(root, notes)
    for old in root.findall("mujoco"):
        root.remove(old)
    options = ET.SubElement(root, "mujoco")
    ET.SubElement(
        options, "compiler", fusestatic="false", discardvisual="false", strippath="false"
    ).set("balanceinertia", "true")
    try:
        text = ET.tostring(root, encoding="unicode")
        model = compile_spec(mujoco.MjSpec.from_string(text, assets=shapes.hulls), notes)
    except MODEL_ERRORS as error:
        raise ModelImportError(f"{path}: {describe(error)}") from error
    return ModelSource(
        path=path,
        model=model,
        actuators=dict(_list_limits(root)),
        ties=tuple(_list_mimics(root)),
        notes=tuple(notes),
        flat=shapes.flat,
        is_floating=True,
    )


def _give_mass(root: ET.Element, notes: list[str]) -> None:
    """Give massless moving links without shape a small mass, as a simulation requires."""
    moving = {
        joint.find("child").get("link")  # type: ignore[union-attr]
        for joint in root.findall("joint")
        if joint.get("type") in MOVING and joint.find("child") is not None
    }
    bare, inferred = [], []
    for link in root.findall("link"):
        name = link.get("name", "")
        mass = link.find("inertial/mass")
        if name not in moving or read_number(mass, "value") > 0.0:
            continue
        if mass is None and link.find("collision") is not None:
            inferred.append(name)
            continue
        for old in link.findall("inertial"):
            link.remove(old)
        inertial = ET.SubElement(link, "inertial")
        ET.SubElement(inertial, "mass", value=f"{LEAST_MASS:g}")
        ET.SubElement(inertial, "inertia", _write_inertia(LEAST_INERTIA))
        bare.append(name)
    if inferred:
        notes.append(f"links without mass get the density of water: {', '.join(inferred)}")
    if bare:
        notes.append(f"links without mass are given {1e3 * LEAST_MASS:g} g: {', '.join(bare)}")


def _mend_inertia(root: ET.Element, notes: list[str]) -> None:
    """Replace physically impossible inertias by that of a ball with the link's mass."""
    mended: dict[str, list[str]] = {}  # names of links by the given inertia
    for link in root.findall("link"):
        inertia = link.find("inertial/inertia")
        weight = read_number(link.find("inertial/mass"), "value")
        if inertia is None or weight <= 0.0:
            continue
        moments = np.zeros((3, 3))
        moments[np.triu_indices(3)] = [read_number(inertia, key) for key in INERTIA]
        if np.linalg.eigvalsh(moments, UPLO="U").min() > LEAST_MOMENT:
            continue
        given = " ".join(f"{key} {inertia.get(key, '0')}" for key in INERTIA)
        radius = (3.0 * weight / (4.0 * np.pi * WATER)) ** (1.0 / 3.0)
        inertia.attrib.update(_write_inertia(max(0.4 * weight * radius**2, LEAST_INERTIA)))
        mended.setdefault(given, []).append(link.get("name", ""))
    notes += [
        f"impossible inertias ({given}) are replaced by those of a ball: {', '.join(names)}"
        for given, names in mended.items()
    ]


def _write_inertia(moment: float) -> dict[str, str]:
    return {key: f"{moment:g}" if key[1] == key[2] else "0" for key in INERTIA}


def _list_mimics(root: ET.Element) -> Iterator[Tie]:
    for joint in root.findall("joint"):
        mimic = joint.find("mimic")
        if mimic is not None:
            ratio = read_number(mimic, "multiplier", 1.0)
            yield Tie.follow(joint.get("name", ""), mimic.get("joint", ""), ratio)


def _list_limits(root: ET.Element) -> Iterator[tuple[str, ActuatorFigures]]:
    for joint in root.findall("joint"):
        if joint.get("type") in ("revolute", "continuous") and joint.find("mimic") is None:
            limit = joint.find("limit")
            effort, speed = (read_number(limit, key) or None for key in ("effort", "velocity"))
            yield joint.get("name", ""), ActuatorFigures(effort=effort, speed=speed)
