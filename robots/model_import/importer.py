"""Imports a model file: finds the robot in it, its stance and its servos."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import mujoco

from robots.body.balanced_stance import BalancedStance
from robots.body.body_plan import BodyPlan
from robots.body.roles import list_rising, list_segments, list_spreading
from robots.model_import.anatomy import find_anatomy
from robots.model_import.brackets import exclude_brackets, find_own_overlaps
from robots.model_import.folding import Fold
from robots.model_import.reading import read_model
from robots.model_import.rebuild import Rebuilder
from robots.model_import.rebuilt import RebuiltModel
from robots.model_import.servo_choice import ServoChoice, choose_servos
from robots.model_import.sites import SOLES, SitePlacer
from robots.model_import.source import ActuatorFigures, ModelImportError
from robots.model_import.stance_search import find_stance
from robots.model_import.tie_reduction import reduce_ties
from robots.model_import.tree import KinematicTree, find_tree
from robots.quaternion import Array
from robots.storage.validation import shown

MOST_LETTERS = 200  # of the name of a joint or a body


@dataclass(frozen=True, eq=False, kw_only=True)
class ImportOptions:
    """Choices of a user for an import."""

    name: str
    """Of the robot."""
    servos: tuple[str, ...] = ()
    """``TYPE`` or ``TYPE=PATTERN``; see :func:`robots.model_import.servo_choice.choose_servos`."""
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
    """Find a robot in an MJCF or URDF file.

    Raises:
        ModelImportError: if there is none, naming all that is wrong.
    """
    source = read_model(path)
    notes, guesses = list(source.notes), []
    tree = find_tree(source, notes)
    if problems := [*_find_name_problems(tree, path, options)]:
        raise ModelImportError(problems)
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
    placer = SitePlacer(path, anatomy, builder, guesses, source.flat)
    placer.add_sites(rebuilt.spec, rebuilt.look())
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
    """Choose servos by the limits of actuators, else by the robot's weight and leg length."""
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
