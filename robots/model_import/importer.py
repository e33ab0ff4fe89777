"""Imports a model file: finds the robot in it, its stance and its servos."""

from __future__ import annotations

import warnings
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import mujoco

from robots.model_import.anatomy import find_anatomy
from robots.model_import.body_plan import BodyPlan, list_rising, list_segments, list_spreading
from robots.model_import.mjcf import read_mjcf
from robots.model_import.rebuild import Rebuilder
from robots.model_import.rebuilt import SOLES, RebuiltModel, SitePlacer
from robots.model_import.servo_choice import ServoChoice, choose_servos
from robots.model_import.source import ActuatorFigures, ModelImportError, ModelSource
from robots.model_import.stance import (
    BalancedStance,
    exclude_brackets,
    find_own_overlaps,
    find_stance,
)
from robots.model_import.ties import Fold, reduce_ties
from robots.model_import.tree import KinematicTree, find_tree
from robots.model_import.urdf import read_urdf
from robots.quaternion import Array
from robots.storage.files import describe, read_bounded
from robots.storage.model_files import MAX_MODEL, parse_xml
from robots.storage.validation import shown


def read_model(path: Path) -> ModelSource:
    """Read a model file: MJCF or URDF, distinguished by their root element."""
    try:
        root = parse_xml(read_bounded(path, MAX_MODEL))
    except (OSError, ValueError) as error:
        reason = describe(error)
        if ", expected " not in reason:
            reason += ", expected an MJCF or URDF file"
        raise ModelImportError(f"{path}: {reason}") from error
    if problem := _find_kind_problem(path, root):
        raise ModelImportError(f"{path}: {problem}")
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", UserWarning)  # as MuJoCo's are
        source = read_urdf(path, root) if root.tag == "robot" else read_mjcf(path)
    texts = [" ".join(str(warning.message).split()) for warning in caught]
    if not texts:
        return source
    count = "once" if len(texts) == 1 else f"{len(texts)} times, first"
    return replace(source, notes=(*source.notes, f"MuJoCo warns {count}: {texts[0]}"))


def _find_kind_problem(path: Path, root: ET.Element) -> str | None:
    """Describe why a file is of an unknown kind; None if its kind is known."""
    if root.tag not in ("robot", "mujoco"):
        return f"its root is <{root.tag}>, expected <mujoco> (MJCF) or <robot> (URDF)"
    if any("xacro" in str(element.tag).partition("}")[0] for element in root.iter()):
        return f"it is a xacro source, expected the URDF made of it: xacro {path.name} > robot.urdf"
    if root.tag == "mujoco" and path.suffix not in (".xml", ".urdf"):  # as MuJoCo demands
        return f"an MJCF file that ends in {shown(path.suffix)}, expected .xml: rename it"
    return None


MOST_LETTERS = 200  # of the name of a joint or a body


@dataclass(frozen=True, eq=False, kw_only=True)
class ImportOptions:
    """Choices of a user for an import."""

    name: str
    """Of the robot."""
    servos: tuple[str, ...] = ()
    """``TYPE`` or ``TYPE=PATTERN``; see `choose_servos`."""
    keep_hulls: bool = False
    """Whether meshes become convex hulls instead of boxes and capsules."""
    fixed: tuple[str, ...] = ()
    """Joints without servo that are fixed in their present place."""


@dataclass(frozen=True, eq=False, kw_only=True)
class ImportedRobot:
    """The robot found in a model file."""

    options: ImportOptions
    spec: mujoco.MjSpec
    """Its own model, with sites."""
    torso: str
    joints: tuple[str, ...]
    mirror: tuple[int, ...]
    """Index of the counterpart of each joint."""
    mirror_sign: tuple[int, ...]
    segments: tuple[str, ...]
    stance: BalancedStance
    servos: ServoChoice
    rising_joints: tuple[str, ...]
    spreading_joints: tuple[str, ...]
    passive_joints: tuple[str, ...]
    notes: tuple[str, ...]
    """Messages: changes, and what could not be found."""
    folds: tuple[Fold, ...] = ()
    """Gears and couplings between servos and joints."""
    guesses: tuple[str, ...] = field(default=())
    """What was guessed, and how to confirm it."""


def import_model(path: Path, options: ImportOptions) -> ImportedRobot:
    """Find a robot in an MJCF or URDF file."""
    source = read_model(path)
    notes, guesses = list(source.notes), []
    tree = find_tree(source, notes)
    if problems := [*_find_name_problems(tree, path, options)]:
        raise ModelImportError(*problems)
    anatomy = find_anatomy(tree, path, notes)
    reduction = reduce_ties(source, tree, notes)
    fixed = {*options.fixed, *reduction.motors}
    fixed |= {each.joint for each in reduction.followers if each.leader in fixed}
    followers = [each for each in reduction.followers if each.joint not in fixed]
    builder = Rebuilder(
        anatomy, keep_hulls=options.keep_hulls, fixed=fixed, followers=followers, notes=notes
    )
    passive = {each.joint for each in followers}
    rebuilt = RebuiltModel(path, options.name, anatomy, builder, fixed=fixed, passive=passive)
    SitePlacer(rebuilt, guesses, source.flat).add_sites()
    rebuilt.compile()
    body = rebuilt.describe(SOLES)
    notes += body.find_contradictions()
    if source.stance:
        guesses.append("standing: started from the model's keyframe, then balanced")
    stance = find_stance(body, rebuilt.start_angles(), notes)
    _settle_contacts(rebuilt, stance.joint_pos, notes, guesses)
    servos = _choose_servos(body, stance, reduction.actuators, options, guesses)
    return ImportedRobot(
        options=options,
        spec=rebuilt.spec,
        torso=rebuilt.model.body(1).name,
        joints=body.joint_names,
        mirror=tuple(int(k) for k in body.mirror.index),
        mirror_sign=tuple(int(s) for s in body.mirror.sign),
        segments=list_segments(body, rebuilt.start_angles()),
        stance=stance,
        servos=servos,
        rising_joints=list_rising(body, stance.joint_pos),
        spreading_joints=list_spreading(body, stance.joint_pos),
        passive_joints=body.passive,
        notes=tuple(notes),
        folds=source.folds,
        guesses=(*guesses, *(fold.describe() for fold in source.folds), *servos.guesses),
    )


def _find_name_problems(tree: KinematicTree, path: Path, options: ImportOptions) -> Iterator[str]:
    """Find names that a robot.toml cannot hold, or that the model does not have."""
    joints = [hinge.name for hinge in tree.hinges]
    bodies = [tree.model.body(body).name for body in tree.bodies]
    if not _is_printable(options.name):
        yield f"--name is {shown(options.name)}, expected printable characters, one or more"
    for kind, names in (("joint", joints), ("body", bodies)):
        for name in names:
            if len(name) > MOST_LETTERS:
                yield (
                    f"{path}: {kind} {shown(name)} has a name of {len(name)} characters, expected "
                    f"at most {MOST_LETTERS}"
                )
            elif name and not _is_printable(name):
                yield f"{path}: {kind} {shown(name)} is named so, expected printable characters"
    for name in options.fixed:
        if name not in joints:
            yield f"--fix is {shown(name)}, expected one of {', '.join(joints)}"


def _is_printable(name: str) -> bool:
    return bool(name.strip()) and name.isprintable()


def _settle_contacts(
    rebuilt: RebuiltModel, stance: Array, notes: list[str], guesses: list[str]
) -> None:
    """Switch off contacts that exist by construction; report those that remain."""
    if listed := exclude_brackets(rebuilt.spec, rebuilt.view, stance):
        guesses.append(f"contacts switched off, as shapes overlap there: {listed}")
    rebuilt.compile()
    model = rebuilt.model
    for (a, b), depth in find_own_overlaps(rebuilt.view, stance).items():
        notes.append(
            f"in the stance {model.body(a).name} reaches {1e3 * depth:.0f} mm into "
            f"{model.body(b).name}: change [standing] or the shapes in model.xml"
        )


def _choose_servos(
    body: BodyPlan,
    stance: BalancedStance,
    actuators: Mapping[str, ActuatorFigures],
    options: ImportOptions,
    guesses: list[str],
) -> ServoChoice:
    names = body.joint_names
    body.view.look(stance.joint_pos)
    servos = choose_servos(
        names,
        actuators,
        options.servos,
        weight=float(body.model.body_mass.sum()),
        leg_length=body.left_leg.measure_stretched(),
    )
    silent = [name for name in names if actuators and name not in actuators]
    if silent:
        guesses.append(
            f"servos of {', '.join(silent)}: the model has no actuator there; fix joints that "
            "do not move with --fix JOINT"
        )
    return servos
