"""Model files: an MJCF or URDF read into an MjSpec, with what it says of actuators."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import mujoco
import numpy as np

from robots.files import read_bounded
from robots.model_import.folding import Fold, find_folds, fold
from robots.validation import shown

MAX_MODEL = 32 * 2**20  # bytes of the XML file
MESH_KINDS = (".stl", ".obj", ".msh")
MAX_LIMIT = 4.0 * np.pi  # rad; a joint that turns farther was meant in degrees


class ImportFault(ValueError):
    """A model file cannot become a robot; one problem a line."""

    def __init__(self, problems: Iterable[str]) -> None:
        self.problems = tuple(problems)
        super().__init__("; ".join(self.problems))


@dataclass(frozen=True, kw_only=True)
class ActuatorFigures:
    """What a model says of the actuator of a joint; None where it says nothing."""

    effort: float | None = None
    """Largest torque at the joint, or of the motor in front of its gear [N·m]."""
    speed: float | None = None
    """Largest speed of the joint [rad/s]."""


@dataclass(frozen=True, eq=False, kw_only=True)
class ModelSource:
    """A model file as read."""

    path: Path
    model: mujoco.MjModel
    actuators: dict[str, ActuatorFigures]
    """By joint name, of the joints that have one; empty if the model says nothing."""
    stance: dict[str, float] = field(default_factory=dict)
    """Angles of a keyframe by joint name [rad]; empty without keyframes."""
    folds: tuple[Fold, ...] = ()
    """Drives whose motors' hinges were fixed; their actuators are under the driven joints."""


def read_model(path: Path) -> ModelSource:
    """Read a model file.

    Raises:
        ImportFault: if it cannot be read, is neither MJCF nor URDF, or does not compile.
    """
    try:
        content = read_bounded(path, MAX_MODEL)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise ImportFault([f"{path}: {reason}, expected an MJCF or URDF file"]) from error
    try:
        root = ET.fromstring(content)
    except ET.ParseError as error:
        raise ImportFault([f"{path}: not XML ({error})"]) from error
    if root.tag == "robot":
        return _read_urdf(path, root)
    if root.tag == "mujoco":
        return _read_mjcf(path)
    raise ImportFault(
        [f"{path}: its root is <{root.tag}>, expected <mujoco> (MJCF) or <robot> (URDF)"]
    )


def _read_mjcf(path: Path) -> ModelSource:
    try:
        spec = mujoco.MjSpec.from_file(str(path))
        spec.compiler.fusestatic = False
        model = spec.compile()
    except (ValueError, mujoco.FatalError) as error:
        raise ImportFault([f"{path}: {' '.join(str(error).split())}"]) from error
    stance, qpos = {}, model.qpos0
    if model.nkey:
        names = [model.key(k).name for k in range(model.nkey)]
        key = next((k for k, name in enumerate(names) if _names_a_stance(name)), 0)
        qpos = model.key_qpos[key]
        stance = {
            model.joint(j).name: float(model.key_qpos[key, model.jnt_qposadr[j]])
            for j in range(model.njnt)
            if model.jnt_type[j] == mujoco.mjtJoint.mjJNT_HINGE
        }
    actuators = _list_actuators(model)
    if folds := find_folds(model, qpos):
        fold(spec, folds)
        model = spec.compile()
        moved = {m: j for each in folds for m, j in zip(each.motors, each.joints, strict=True)}
        actuators = {moved.get(name, name): figures for name, figures in actuators.items()}
    return ModelSource(
        path=path, model=model, actuators=actuators, stance=stance, folds=tuple(folds)
    )


def _names_a_stance(name: str) -> bool:
    return any(word in name.lower() for word in ("home", "stand", "ready", "init"))


def _list_actuators(model: mujoco.MjModel) -> dict[str, ActuatorFigures]:
    """Read the largest torques of joints from actuators on them, their ranges and gains."""
    found: dict[str, ActuatorFigures] = {}
    for i in range(model.nu):
        if model.actuator_trntype[i] != mujoco.mjtTrn.mjTRN_JOINT:
            continue
        joint = int(model.actuator_trnid[i, 0])
        bounds = [_actuator_effort(model, i)]
        if model.jnt_actfrclimited[joint]:
            bounds.append(float(np.abs(model.jnt_actfrcrange[joint]).max()))
        known = [bound for bound in bounds if bound is not None]
        effort = min(known) if known else None
        found[model.joint(joint).name] = ActuatorFigures(effort=effort)
    if not found:  # limits of joints alone, as a model without actuators may state them
        for joint in np.flatnonzero(model.jnt_actfrclimited):
            effort = float(np.abs(model.jnt_actfrcrange[joint]).max())
            found[model.joint(joint).name] = ActuatorFigures(effort=effort)
    return found


def _actuator_effort(model: mujoco.MjModel, i: int) -> float | None:
    gear = abs(float(model.actuator_gear[i, 0]))
    if model.actuator_forcelimited[i]:
        return gear * float(np.abs(model.actuator_forcerange[i]).max())
    is_motor = model.actuator_biastype[i] == mujoco.mjtBias.mjBIAS_NONE
    if is_motor and model.actuator_ctrllimited[i]:
        gain = abs(float(model.actuator_gainprm[i, 0]))
        return gear * gain * float(np.abs(model.actuator_ctrlrange[i]).max())
    return None


def _read_urdf(path: Path, root: ET.Element) -> ModelSource:
    problems = [*_find_limit_problems(path, root), *_resolve_meshes(path, root)]
    if problems:
        raise ImportFault(problems)
    for old in root.findall("mujoco"):
        root.remove(old)
    options = ET.SubElement(root, "mujoco")
    ET.SubElement(
        options, "compiler", fusestatic="false", discardvisual="false", strippath="false"
    ).set("balanceinertia", "true")
    try:
        spec = mujoco.MjSpec.from_string(ET.tostring(root, encoding="unicode"))
        model = spec.compile()
    except (ValueError, mujoco.FatalError) as error:
        raise ImportFault([f"{path}: {' '.join(str(error).split())}"]) from error
    return ModelSource(path=path, model=model, actuators=dict(_list_limits(root)))


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


def _resolve_meshes(path: Path, root: ET.Element) -> list[str]:
    """Replace the file names of meshes by full paths; return problems.

    A visual shape is dropped where its link has collision shapes of its own.
    """
    problems = []
    for link in root.findall("link"):
        if link.find("collision") is not None:
            for visual in link.findall("visual"):
                link.remove(visual)
        for mesh in link.iter("mesh"):
            name = mesh.get("filename", "")
            file = _find_mesh(path, name)
            if file is None:
                problems.append(
                    f"{path}: mesh {shown(name)} of link {shown(link.get('name'))} is not found, "
                    "expected it beside the model, or in a folder above"
                )
            elif file.suffix.lower() not in MESH_KINDS:
                problems.append(
                    f"{path}: mesh {shown(name)} of link {shown(link.get('name'))} is of kind "
                    f"{shown(file.suffix)}, expected {', '.join(MESH_KINDS)}"
                )
            else:
                mesh.set("filename", str(file))
    return problems


def _find_mesh(path: Path, name: str) -> Path | None:
    """Find a mesh by its name in a URDF: a path, file://..., or package://NAME/..."""
    plain = name.removeprefix("file://")
    parts = Path(plain.removeprefix("package://")).parts
    places = [path.parent / plain, *(up.joinpath(*parts) for up in path.resolve().parents)]
    places += [up.joinpath(*parts[1:]) for up in path.resolve().parents if len(parts) > 1]
    found = next((place for place in places if place.is_file()), None)
    return None if found is None else found.resolve()
