"""Imports a model file: finds the robot in it, its stance and its servos."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import mujoco
import numpy as np

from robots.model_import.anatomy import Anatomy, find_anatomy
from robots.model_import.contacts import find_brackets, find_overlaps
from robots.model_import.couplings import reduce_couplings
from robots.model_import.folding import Fold
from robots.model_import.reading import read_model
from robots.model_import.rebuild import Rebuilder
from robots.model_import.servo_choice import ServoChoice, choose_servos
from robots.model_import.sites import SOLES, SitePlacer
from robots.model_import.source import ImportFault, ModelSource
from robots.model_import.stance import SPREADS, Body, Stance, StanceSolver
from robots.model_import.tree import find_tree
from robots.quaternion import Array
from robots.validation import shown

EXTENSIONS = (0.94, 0.9, 0.86, 0.82, 0.78, 0.7)
"""Shares of the stretched leg that are tried for the stance, in turn."""
LEAST_ROOM = 0.2  # share of a joint's range that the range of its mirror joint must leave
TWIST = 0.8  # cosine between a hinge and its limb from which it only twists it


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
    stance: Stance
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
        ImportFault: if there is none, naming all that is wrong.
    """
    source = read_model(path)
    notes = list(source.notes)
    tree = find_tree(source, notes)
    anatomy = find_anatomy(tree, path, notes)
    unknown = [name for name in options.fixed if name not in [h.name for h in tree.hinges]]
    if unknown:
        listed = ", ".join(hinge.name for hinge in tree.hinges)
        raise ImportFault([f"--fix is {shown(name)}, expected one of {listed}" for name in unknown])
    reduction = reduce_couplings(source, tree, notes)
    source = replace(source, actuators=reduction.actuators)
    fixed = {*options.fixed, *reduction.motors}
    builder = Rebuilder(anatomy, keep_hulls=options.keep_hulls, fixed=fixed, notes=notes)
    return _Import(source, anatomy, builder, options, fixed, notes).finish()


class _Import:
    """One import, from the rebuilt model on."""

    def __init__(
        self,
        source: ModelSource,
        anatomy: Anatomy,
        builder: Rebuilder,
        options: ImportOptions,
        fixed: Collection[str],
        notes: list[str],
    ) -> None:
        self._source, self._anatomy, self._builder = source, anatomy, builder
        self._spec = builder.build(options.name)
        self._options, self._notes, self._guesses = options, notes, []
        self._kept = [k for k, hinge in enumerate(anatomy.tree.hinges) if hinge.name not in fixed]
        self._model = self._compile()

    def finish(self) -> ImportedRobot:
        """Find all the rest."""
        start = self._start_angles()
        places = SitePlacer(self._source.path, self._anatomy, self._builder, self._guesses)
        places.add_sites(self._spec, self._look(start))
        self._model = self._compile()
        body = self._describe_body()
        self._report_contradictions(body)
        stance = self._find_stance(body, start)
        self._exclude_brackets(stance)
        self._report_touching(stance)
        names = tuple(self._hinge_name(k) for k in range(len(self._kept)))
        solver_leg = StanceSolver(body, stance.joint_pos).leg_length
        servos = choose_servos(
            names,
            self._source.actuators,
            self._options.servos,
            weight=float(self._model.body_mass.sum()),
            leg_length=solver_leg,
        )
        silent = [n for n in names if self._source.actuators and n not in self._source.actuators]
        if silent:
            self._guesses.append(
                f"servos of {', '.join(silent)}: the model has no actuator there; fix joints that "
                "do not move with --fix JOINT"
            )
        self._guesses += [fold.describe() for fold in self._source.folds]
        return ImportedRobot(
            options=self._options,
            spec=self._spec,
            torso=self._model.body(1).name,
            joints=names,
            mirror=tuple(int(k) for k in body.mirror.index),
            mirror_sign=tuple(int(s) for s in body.mirror.sign),
            segments=self._list_segments(body),
            stance=stance,
            servos=servos,
            rising_joints=self._list_rising(body, stance),
            spreading_joints=self._list_spreading(body, stance),
            notes=tuple(self._notes),
            folds=self._source.folds,
            guesses=(*self._guesses, *servos.guesses),
        )

    def _compile(self) -> mujoco.MjModel:
        try:
            return self._spec.compile()
        except (ValueError, mujoco.FatalError) as error:
            message = " ".join(str(error).split())
            raise ImportFault([f"{self._source.path}: {message}"]) from error

    def _hinge_name(self, hinge: int) -> str:
        return self._model.joint(hinge + 1).name

    def _start_angles(self) -> Array:
        tree = self._anatomy.tree
        angles = np.array(
            [tree.data.qpos[tree.model.jnt_qposadr[tree.hinges[k].id]] for k in self._kept]
        )
        return np.clip(angles, self._model.jnt_range[1:, 0], self._model.jnt_range[1:, 1])

    def _place(self, hinge: int) -> int | None:
        """Return the place of one of the tree's hinges among those that are kept."""
        return self._kept.index(hinge) if hinge in self._kept else None

    def _describe_body(self) -> Body:
        anatomy, mirror = self._anatomy, self._anatomy.mirror
        index = [self._place(int(mirror.index[k])) for k in self._kept]
        kept = {k: i for i, k in enumerate(self._kept)}
        chains = lambda limb: tuple(kept[k] for k in limb if k in kept)  # noqa: E731
        return Body(
            model=self._model,
            mirror=type(mirror)(
                np.array([i if j is None else j for i, j in enumerate(index)]),
                mirror.sign[self._kept],
                (),
            ),
            legs=(chains(anatomy.legs[0]), chains(anatomy.legs[1])),
            arms=tuple(
                (chains(left), chains(right))
                for left, right in anatomy.arms
                if chains(left) and chains(right)
            ),
            soles=SOLES,
        )

    def _report_contradictions(self, body: Body) -> None:
        """Report pairs of which one can only turn to where the other cannot."""
        for k, other in enumerate(body.mirror.index):
            images = body.mirror.sign[k] * np.array([body.lower[other], body.upper[other]])
            room = min(body.upper[k], images.max()) - max(body.lower[k], images.min())
            widest = min(body.upper[k] - body.lower[k], np.ptp(images))
            if k < other and room < LEAST_ROOM * widest:
                one, two = self._hinge_name(k), self._hinge_name(int(other))
                self._notes.append(
                    f"joints {one} and {two} mirror each other, but not their ranges, "
                    f"{_range(body, k)} and {_range(body, int(other))}: the model has a wrong axis "
                    "or range there; correct it"
                )

    def _look(self, angles: Array) -> mujoco.MjData:
        data = mujoco.MjData(self._model)
        data.qpos[7:] = angles
        mujoco.mj_kinematics(self._model, data)
        mujoco.mj_comPos(self._model, data)
        return data

    def _find_stance(self, body: Body, start: Array) -> Stance:
        if self._source.stance:
            self._guesses.append("standing: begun from the model's keyframe, then balanced")
        solver, best = StanceSolver(body, start), None
        for extension in EXTENSIONS:
            stance = solver.solve(extension)
            best = stance if best is None or stance.error < best.error else best
            if stance.is_solved:
                return self._free_arms(solver, stance, extension)
        assert best is not None  # there is at least one extension
        self._notes.append(
            f"no balanced stance on flat soles was found (off by {best.error:.2f} leg lengths): "
            "write [standing] by hand, then getup robots check"
        )
        return best

    def _free_arms(self, solver: StanceSolver, stance: Stance, extension: float) -> Stance:
        """Spread the arms until they touch nothing but what they always touch."""
        always = {*find_brackets(self._model, stance.joint_pos, np.random.default_rng(0))}
        moved = [k for pair in self._anatomy.arms for limb in pair for k in limb[1:]]
        arms = {int(self._model.body(self._builder.carrier(k)).id) for k in moved}
        for spread in SPREADS:
            tried = solver.solve(extension, spread)
            touching = find_overlaps(self._model, tried.joint_pos).keys() - always
            if tried.is_solved and not any(set(pair) & arms for pair in touching):
                return tried
        return stance

    def _exclude_brackets(self, stance: Stance) -> None:
        pairs = find_brackets(self._model, stance.joint_pos, np.random.default_rng(0))
        for first, second in pairs:
            names = [self._model.body(body).name for body in (first, second)]
            self._spec.add_exclude(bodyname1=names[0], bodyname2=names[1])
        if pairs:
            listed = ", ".join(
                f"{self._model.body(a).name} with {self._model.body(b).name}" for a, b in pairs
            )
            self._guesses.append(f"contacts switched off, as shapes overlap there: {listed}")
        self._model = self._compile()

    def _report_touching(self, stance: Stance) -> None:
        for (a, b), depth in find_overlaps(self._model, stance.joint_pos).items():
            self._notes.append(
                f"in the stance {self._model.body(a).name} reaches {1e3 * depth:.0f} mm into "
                f"{self._model.body(b).name}: change [standing] or the shapes in model.xml"
            )

    def _list_segments(self, body: Body) -> tuple[str, ...]:
        segments = ["other"] * len(self._kept)
        for k in self._anatomy.head:
            if (place := self._place(k)) is not None:
                segments[place] = "head"
        for leg in body.legs:
            across = [k for k in leg if self._is_pitch(k)]
            for k in leg[leg.index(across[len(across) // 2]) + 1 :] if len(across) >= 3 else ():
                segments[k] = "foot"
        return tuple(segments)

    def _is_pitch(self, hinge: int) -> bool:
        return abs(self._look_axis(hinge)[1]) > TWIST

    def _look_axis(self, hinge: int, angles: Array | None = None) -> Array:
        data = self._look(self._start_angles() if angles is None else angles)
        return data.xaxis[hinge + 1]

    def _list_rising(self, body: Body, stance: Stance) -> tuple[str, ...]:
        """List hips, knees and ankles, and of an arm the three that do not twist it."""
        data = self._look(stance.joint_pos)
        rising = []
        for left, _ in body.arms[:1]:
            bending = [k for k in left if not self._twists(k, left, data)]
            rising += bending[:3]
        rising += [k for k in body.legs[0] if abs(data.xaxis[k + 1][1]) > TWIST]
        return tuple(self._hinge_name(k) for k in rising)

    def _twists(self, hinge: int, limb: Sequence[int], data: mujoco.MjData) -> bool:
        """Tell whether a hinge only turns the rest of its limb about itself."""
        anchor = data.xanchor[hinge + 1]
        end = self._model.jnt_bodyid[limb[-1] + 1]
        way = 2.0 * data.subtree_com[end] - data.xanchor[limb[-1] + 1] - anchor
        return bool(abs(way @ data.xaxis[hinge + 1]) > TWIST * np.linalg.norm(way))

    def _list_spreading(self, body: Body, stance: Stance) -> tuple[str, ...]:
        """List the hinge of the leg above the knee that rolls it most."""
        data, leg = self._look(stance.joint_pos), body.legs[0]
        across = [k for k in leg if abs(data.xaxis[k + 1][1]) > TWIST]
        knee = across[len(across) // 2] if across else leg[-1]
        hip = [k for k in leg if k < knee and k not in across] or [leg[0]]
        return (self._hinge_name(max(hip, key=lambda k: abs(data.xaxis[k + 1][0]))),)


def _range(body: Body, hinge: int) -> str:
    lower, upper = np.degrees([body.lower[hinge], body.upper[hinge]])
    return f"{lower:.0f} to {upper:.0f} deg"
