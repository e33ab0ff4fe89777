"""URDF files: a model with its meshes, what its limits say of motors, and what is tied."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterator
from pathlib import Path

import mujoco
import numpy as np

from robots.model_import.rebuild import LEAST_INERTIA, LEAST_MASS
from robots.model_import.source import ActuatorFigures, ModelImportError, ModelSource
from robots.model_import.ties import Tie
from robots.model_import.urdf_shapes import UrdfShapes
from robots.validation import shown

MAX_LIMIT = 4.0 * np.pi  # rad; a joint that turns farther was meant in degrees
LEAST_MOMENT = 1e-12  # kg·m², of what MuJoCo takes for positive
WATER = 1000.0  # kg/m³
INERTIA = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
MOVING = ("revolute", "continuous", "prismatic")


def read_urdf(path: Path, root: ET.Element) -> ModelSource:
    """Read a URDF file.

    Args:
        path: The file.
        root: Its element; changed.

    Raises:
        ModelImportError: if it does not compile, or its meshes cannot be read.
    """
    notes: list[str] = []
    shapes = UrdfShapes(path, root, notes)
    problems = [*_find_limit_problems(path, root), *shapes.resolve()]
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
        model = _compile(mujoco.MjSpec.from_string(text, assets=shapes.hulls), notes)
    except (ValueError, mujoco.FatalError) as error:
        raise ModelImportError([f"{path}: {' '.join(str(error).split())}"]) from error
    return ModelSource(
        path=path,
        model=model,
        actuators=dict(_list_limits(root)),
        ties=tuple(_list_mimics(root)),
        notes=tuple(notes),
    )


def _compile(spec: mujoco.MjSpec, notes: list[str]) -> mujoco.MjModel:
    """Compile; flat meshes are taken for shells."""
    try:
        return spec.compile()
    except ValueError as error:
        if "mesh volume" not in str(error):
            raise
    notes.append("meshes are taken for shells, as some have no volume")
    for mesh in spec.meshes:
        mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
    return spec.compile()


def _give_mass(root: ET.Element, notes: list[str]) -> None:
    """Give links without mass and shape that move a little, as a simulation requires."""
    moving = {
        joint.find("child").get("link")  # type: ignore[union-attr]
        for joint in root.findall("joint")
        if joint.get("type") in MOVING and joint.find("child") is not None
    }
    bare, inferred = [], []
    for link in root.findall("link"):
        name = link.get("name", "")
        mass = link.find("inertial/mass")
        if name not in moving or (mass is not None and float(mass.get("value", "0")) > 0.0):
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
        notes.append(f"mass as of water for links without mass: {', '.join(inferred)}")
    if bare:
        notes.append(f"links without mass are given {1e3 * LEAST_MASS:g} g: {', '.join(bare)}")


def _mend_inertia(root: ET.Element, notes: list[str]) -> None:
    """Replace inertias that no body can have by that of a ball as heavy as the link."""
    mended = []
    for link in root.findall("link"):
        inertia, mass = link.find("inertial/inertia"), link.find("inertial/mass")
        if inertia is None or mass is None or float(mass.get("value", "0")) <= 0.0:
            continue
        xx, yy, zz, xy, xz, yz = (float(inertia.get(key, "0")) for key in INERTIA)
        if np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]).min() > LEAST_MOMENT:
            continue
        weight = float(mass.get("value", "0"))
        radius = (3.0 * weight / (4.0 * np.pi * WATER)) ** (1.0 / 3.0)
        inertia.attrib.update(_write_inertia(max(0.4 * weight * radius**2, LEAST_INERTIA)))
        mended.append(link.get("name", ""))
    if mended:
        notes.append(f"inertia of a ball for links whose own no body can have: {', '.join(mended)}")


def _write_inertia(moment: float) -> dict[str, str]:
    return {key: f"{moment:g}" if key in INERTIA[:3] else "0" for key in INERTIA}


def _list_mimics(root: ET.Element) -> Iterator[Tie]:
    for joint in root.findall("joint"):
        mimic = joint.find("mimic")
        if mimic is not None:
            ratio = float(mimic.get("multiplier", "1"))
            yield Tie.follow(joint.get("name", ""), mimic.get("joint", ""), ratio)


def _find_limit_problems(path: Path, root: ET.Element) -> Iterator[str]:
    for joint in root.findall("joint"):
        limit = joint.find("limit")
        if joint.get("type") != "revolute" or limit is None:
            continue
        far = max(abs(float(limit.get(key, "0"))) for key in ("lower", "upper"))
        if far > MAX_LIMIT:
            yield (
                f"{path}: joint {shown(joint.get('name'))} has a limit of {far:g} rad, expected at "
                f"most {MAX_LIMIT:.1f} rad: limits of a URDF are in rad"
            )


def _list_limits(root: ET.Element) -> Iterator[tuple[str, ActuatorFigures]]:
    for joint in root.findall("joint"):
        limit = joint.find("limit")
        is_driven = joint.get("type") in ("revolute", "continuous") and joint.find("mimic") is None
        if is_driven:
            figures = {} if limit is None else limit.attrib
            effort, speed = (float(figures.get(key, "0")) for key in ("effort", "velocity"))
            yield (
                joint.get("name", ""),
                ActuatorFigures(
                    effort=effort if effort > 0.0 else None, speed=speed if speed > 0.0 else None
                ),
            )
