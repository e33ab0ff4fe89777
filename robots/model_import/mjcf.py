"""MJCF files: a model, the limits of its actuators, its ties, and a keyframe."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import mujoco
import numpy as np

from robots.description.model_checks import HINGE, find_number_problems
from robots.model_import.source import (
    ActuatorFigures,
    Fold,
    ModelImportError,
    ModelSource,
    Tie,
    check_size,
    compile_spec,
    find_range_problems,
)
from robots.model_import.ties import describe_separate, find_folds, fold, group_ties, list_ties
from robots.quaternion import Array
from robots.storage.files import describe
from robots.storage.model_files import MODEL_ERRORS, find_file_problems
from robots.storage.validation import shown

STANCES = ("home", "stand", "ready", "init")
IN_RADIANS = "it is in degrees unless <compiler> has angle 'radian'"
FAR = 2.0  # a hinge's point is far from the center of mass if the body's origin is so much nearer
FULL_TURN = 2.0 * np.pi - 1e-3  # rad, from which a range is none


def read_mjcf(path: Path) -> ModelSource:
    """Read an MJCF file."""
    if problems := find_file_problems(path):
        raise ModelImportError(*(f"{path}: {problem}" for problem in problems))
    notes: list[str] = []
    try:
        spec = mujoco.MjSpec.from_file(str(path))
        spec.compiler.fusestatic = False
        _forget_scene(spec)
        model = compile_spec(spec, notes)
    except MODEL_ERRORS as error:
        raise ModelImportError(f"{path}: {describe(error)}") from error
    if problems := [*find_number_problems(model), *_find_range_problems(spec, model)]:
        raise ModelImportError(*(f"{path}: {problem}" for problem in problems))
    check_size(path, bodies=model.nbody - 1, joints=model.njnt)
    # The keyframe that is named as a stance, or the first one.
    keys = {k: model.key(k).name.lower() for k in range(model.nkey)}
    named = (k for k, name in keys.items() if any(word in name for word in STANCES))
    key = next(named, 0 if keys else None)
    qpos = model.qpos0 if key is None else model.key_qpos[key]
    hinges = [] if key is None else np.flatnonzero(model.jnt_type == HINGE)
    stance = {model.joint(j).name: float(qpos[model.jnt_qposadr[j]]) for j in hinges}
    actuators, ranges = _list_actuators(model), _list_ranges(model)
    ties = list_ties(model, qpos)
    if folds := find_folds(model, ties):
        fold(spec, folds)
        model = spec.compile()
        moved = {m: j for each in folds for m, j in zip(each.motors, each.joints, strict=True)}
        actuators = {moved.get(name, name): figures for name, figures in actuators.items()}
    _slide_anchors(model)
    notes += [*(_list_separate(ties, folds) if folds else ()), *_set_ranges(model, ranges)]
    return ModelSource(
        path=path,
        model=model,
        actuators=actuators,
        stance=stance,
        folds=tuple(folds),
        ties=() if folds else tuple(tie for tie in ties if not tie.is_loop),
        loops=tuple(_list_loops(model)),
        notes=tuple(notes),
    )


def _find_range_problems(spec: mujoco.MjSpec, model: mujoco.MjModel) -> Iterator[str]:
    """Find hinges with a wrong range, which MuJoCo ignores if its ends are reversed."""
    for joint in spec.joints:
        if joint.type == HINGE and joint.limited != mujoco.mjtLimited.mjLIMITED_FALSE:
            ends = model.jnt_range[joint.id]
            if not model.jnt_limited[joint.id] and spec.compiler.degree:
                ends = np.radians(ends)  # as MuJoCo does with a range that it takes
            lower, upper = (float(end) for end in ends)
            for problem in find_range_problems(lower, upper, IN_RADIANS):
                yield f"joint {shown(joint.name)} {problem}"


def _slide_anchors(model: mujoco.MjModel) -> None:
    """Slide hinges' points far off their bodies' centers to the bodies' origins, along the axes."""
    for joint in np.flatnonzero(model.jnt_type == HINGE):
        point, axis = model.jnt_pos[joint], model.jnt_axis[joint]
        center = model.body_ipos[model.jnt_bodyid[joint]]
        if np.linalg.norm(point - center) > FAR * np.linalg.norm(center):
            model.jnt_pos[joint] = point - axis * (axis @ point)


def _list_separate(ties: Sequence[Tie], folds: Sequence[Fold]) -> Iterator[str]:
    """List the ties that folding removes although they are part of no fold."""
    folded = {name for each in folds for name in (*each.motors, *each.joints, *each.rods)}
    for group in group_ties(tie for tie in ties if not folded & {*tie.joints}):
        yield describe_separate(dict.fromkeys(name for tie in group for name in tie.joints))


def _forget_scene(spec: mujoco.MjSpec) -> None:
    """Remove pairs and sensors, which may be of a scene; shapes of pairs collide by kind."""
    for pair in list(spec.pairs):
        for name in (pair.geomname1, pair.geomname2):
            if (geom := spec.geom(name)) is not None:
                geom.contype = 1
        spec.delete(pair)
    for sensor in list(spec.sensors):
        spec.delete(sensor)


def _list_loops(model: mujoco.MjModel) -> Iterator[tuple[int, int]]:
    for k in range(model.neq):
        kind = mujoco.mjtEq(int(model.eq_type[k]))
        is_loop = kind in (mujoco.mjtEq.mjEQ_CONNECT, mujoco.mjtEq.mjEQ_WELD)
        objects = int(model.eq_obj1id[k]), int(model.eq_obj2id[k])
        if is_loop and model.eq_objtype[k] == mujoco.mjtObj.mjOBJ_BODY:
            yield objects
        elif is_loop:  # between sites
            yield int(model.site_bodyid[objects[0]]), int(model.site_bodyid[objects[1]])


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


def _list_ranges(model: mujoco.MjModel) -> dict[str, Array]:
    """List the ranges of position actuators on joints without range, (2,) each [rad].

    A range that is stated but not enforced counts: its author clips targets elsewhere.
    """
    found: dict[str, Array] = {}
    for i in np.flatnonzero(model.actuator_trntype == mujoco.mjtTrn.mjTRN_JOINT):
        joint, gear = int(model.actuator_trnid[i, 0]), float(model.actuator_gear[i, 0])
        stiffness = float(model.actuator_gainprm[i, 0])
        is_position = stiffness > 0.0 and model.actuator_biasprm[i, 1] == -stiffness
        is_open = model.jnt_type[joint] == HINGE and not model.jnt_limited[joint]
        if is_position and is_open and gear:
            bounds = np.sort(model.actuator_ctrlrange[i] / gear)
            if 0.0 < np.ptp(bounds) < FULL_TURN:
                found[model.joint(joint).name] = bounds
    return found


def _set_ranges(model: mujoco.MjModel, ranges: Mapping[str, Array]) -> Iterator[str]:
    """Give joints of a model, if they are still there, ranges [rad]; say of which."""
    kept = [j for j in range(model.njnt) if model.joint(j).name in ranges]
    for joint in kept:
        model.jnt_range[joint], model.jnt_limited[joint] = ranges[model.joint(joint).name], True
    if kept:
        names = ", ".join(model.joint(j).name for j in kept)
        yield f"ranges of position actuators for joints without range: {names}"


def _actuator_effort(model: mujoco.MjModel, i: int) -> float | None:
    gear = abs(float(model.actuator_gear[i, 0]))
    if model.actuator_forcelimited[i]:
        return gear * float(np.abs(model.actuator_forcerange[i]).max())
    is_motor = model.actuator_biastype[i] == mujoco.mjtBias.mjBIAS_NONE
    if is_motor and model.actuator_ctrllimited[i]:
        gain = abs(float(model.actuator_gainprm[i, 0]))
        return gear * gain * float(np.abs(model.actuator_ctrlrange[i]).max())
    return None
