"""URDF files: a model with its meshes, the limits of its motors, and its ties."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterator
from pathlib import Path

import mujoco
import numpy as np

from robots.model_import.rebuild import LEAST_INERTIA, LEAST_MASS
from robots.model_import.source import (
    ActuatorFigures,
    ModelImportError,
    ModelSource,
    check_size,
    compile_spec,
)
from robots.model_import.ties import Tie
from robots.model_import.urdf_shapes import UrdfShapes
from robots.model_import.urdf_tree import find_tree_problems
from robots.model_import.urdf_values import INERTIA, find_value_problems, read_number
from robots.storage.files import describe
from robots.storage.model_files import MODEL_ERRORS

LEAST_MOMENT = 1e-12  # kg·m²; MuJoCo accepts it as positive
WATER = 1000.0  # kg/m³
MOVING = ("revolute", "continuous", "prismatic")


def read_urdf(path: Path, root: ET.Element) -> ModelSource:
    """Read a URDF file.

    Args:
        path: The file.
        root: Its element; changed.

    Raises:
        ModelImportError: if it has too many parts, does not compile, or its meshes cannot be read.
    """
    check_size(path, links=len(root.findall("link")), joints=len(root.findall("joint")))
    notes: list[str] = []
    shapes = UrdfShapes(path, root, notes)
    problems = find_value_problems(root) or [*find_tree_problems(root)]
    problems = [f"{path}: {problem}" for problem in problems]
    problems += [] if problems else shapes.resolve()
    if problems:
        raise ModelImportError(problems)
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
        raise ModelImportError([f"{path}: {describe(error)}"]) from error
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
        inertia, weight = (
            link.find("inertial/inertia"),
            read_number(link.find("inertial/mass"), "value"),
        )
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
