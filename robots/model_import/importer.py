"""Imports a model file: finds the robot in it, its stance and its servos."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
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
from robots.validation import shown


@dataclass(frozen=True, eq=False, kw_only=True)
class ImportOptions:
    """What a user says of a model."""

    name: str
    """Of the robot."""
    servos: tuple[str, ...] = ()
    """``TYPE`` or ``TYPE=PATTERN``; see :func:`robots.model_import.servo_choice.choose_servos`."""
    keep_hulls: bool = False
    """Whether meshes become convex hulls instead of boxes and capsules."""
    fixed: tuple[str, ...] = ()
    """Joints without servo that are fixed where they stand."""


@dataclass(frozen=True, eq=False, kw_only=True)
class ImportedRobot:
    """A robot as found in a model file."""

    options: ImportOptions
    spec: mujoco.MjSpec
    """Its own model, with sites."""
    torso: str
    joints: tuple[str, ...]
    mirror: tuple[int, ...]
    """Place of the joint that takes each one's place."""
    mirror_sign: tuple[int, ...]
    segments: tuple[str, ...]
    stance: BalancedStance
    servos: ServoChoice
    rising_joints: tuple[str, ...]
    spreading_joints: tuple[str, ...]
    notes: tuple[str, ...]
    """What was changed, and what could not be found."""
    folds: tuple[Fold, ...] = ()
    """Gears and couplings between servos and joints."""
    guesses: tuple[str, ...] = field(default=())
    """What was guessed, and how to confirm it."""


def import_model(path: Path, options: ImportOptions) -> ImportedRobot:
    """Find a robot in an MJCF or URDF file.

    Raises:
        ModelImportError: if there is none, naming all that is wrong.
    """
    if not _is_printable(options.name):
        raise ModelImportError(
            [f"--name is {shown(options.name)}, expected printable characters, one or more"]
        )
    source = read_model(path)
    notes = list(source.notes)
    tree = find_tree(source, notes)
    if problems := [*_find_name_problems(tree)]:
        raise ModelImportError(f"{path}: {problem}" for problem in problems)
    anatomy = find_anatomy(tree, path, notes)
    unknown = [name for name in options.fixed if name not in [h.name for h in tree.hinges]]
    if unknown:
        listed = ", ".join(hinge.name for hinge in tree.hinges)
        raise ModelImportError(
            [f"--fix is {shown(name)}, expected one of {listed}" for name in unknown]
        )
    reduction = reduce_ties(source, tree, notes)
    fixed = {*options.fixed, *reduction.motors}
    builder = Rebuilder(anatomy, keep_hulls=options.keep_hulls, fixed=fixed, notes=notes)
    rebuilt = RebuiltModel(path, options.name, anatomy, builder, fixed)
    guesses: list[str] = []
    start = rebuilt.look(rebuilt.start_angles())
    SitePlacer(path, anatomy, builder, guesses).add_sites(rebuilt.spec, start)
    rebuilt.compile()
    body = rebuilt.describe(SOLES)
    notes += body.find_contradictions()
    if source.stance:
        guesses.append("standing: begun from the model's keyframe, then balanced")
    stance = find_stance(rebuilt, body, notes)
    _settle_contacts(rebuilt, stance.joint_pos, notes, guesses)
    body.view.look(stance.joint_pos)
    leg_length = body.left_leg.measure_stretched()
    servos = _choose_servos(rebuilt, reduction.actuators, options, leg_length, guesses)
    guesses += [fold.describe() for fold in source.folds]
    return ImportedRobot(
        options=options,
        spec=rebuilt.spec,
        torso=rebuilt.model.body(1).name,
        joints=rebuilt.joint_names,
        mirror=tuple(int(k) for k in body.mirror.index),
        mirror_sign=tuple(int(s) for s in body.mirror.sign),
        segments=list_segments(body, rebuilt.start_angles()),
        stance=stance,
        servos=servos,
        rising_joints=_list_paired(list_rising(body, stance.joint_pos), rebuilt, body),
        spreading_joints=_list_paired(list_spreading(body, stance.joint_pos), rebuilt, body),
        notes=tuple(notes),
        folds=source.folds,
        guesses=(*guesses, *servos.guesses),
    )


def _find_name_problems(tree: KinematicTree) -> Iterator[str]:
    """Find names that a robot.toml cannot hold in a line."""
    bodies = [tree.model.body(body).name for body in tree.bodies]
    for kind, names in (("joint", [hinge.name for hinge in tree.hinges]), ("body", bodies)):
        for name in names:
            if name and not _is_printable(name):
                yield f"{kind} {shown(name)} is named so, expected printable characters"


def _is_printable(name: str) -> bool:
    return bool(name.strip()) and name.isprintable()


def _list_paired(joints: Iterable[str], rebuilt: RebuiltModel, body: BodyPlan) -> tuple[str, ...]:
    """Choose the joints that have a mirror image: a robot's two sides may differ."""
    images = dict(zip(rebuilt.joint_names, body.mirror.index, strict=True))
    return tuple(name for name in joints if rebuilt.joint_names[images[name]] != name)


def _settle_contacts(
    rebuilt: RebuiltModel, stance: Array, notes: list[str], guesses: list[str]
) -> None:
    """Switch contacts off that are there by construction; report those that remain."""
    if listed := exclude_brackets(rebuilt.spec, rebuilt.model, stance):
        guesses.append(f"contacts switched off, as shapes overlap there: {listed}")
    rebuilt.compile()
    model = rebuilt.model
    for (a, b), depth in find_own_overlaps(model, stance).items():
        notes.append(
            f"in the stance {model.body(a).name} reaches {1e3 * depth:.0f} mm into "
            f"{model.body(b).name}: change [standing] or the shapes in model.xml"
        )


def _choose_servos(
    rebuilt: RebuiltModel,
    actuators: Mapping[str, ActuatorFigures],
    options: ImportOptions,
    leg_length: float,
    guesses: list[str],
) -> ServoChoice:
    """Choose servos by what actuators can do, else by the robot's weight and leg length [m]."""
    names = rebuilt.joint_names
    weight = float(rebuilt.model.body_mass.sum())
    servos = choose_servos(names, actuators, options.servos, weight=weight, leg_length=leg_length)
    silent = [name for name in names if actuators and name not in actuators]
    if silent:
        guesses.append(
            f"servos of {', '.join(silent)}: the model has no actuator there; fix joints that "
            "do not move with --fix JOINT"
        )
    return servos
