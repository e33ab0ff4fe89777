"""Imports a model file: finds the robot in it, its stance and its servos."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import mujoco
import numpy as np

from robots.model_import.anatomy import Anatomy, find_anatomy
from robots.model_import.contacts import find_brackets, find_overlaps
from robots.model_import.folding import Fold
from robots.model_import.rebuild import Rebuilder
from robots.model_import.servo_choice import ServoChoice, choose_servos
from robots.model_import.soles import Sole, add_sole_site, find_sole
from robots.model_import.source import ImportFault, ModelSource, read_model
from robots.model_import.stance import SPREADS, Body, Stance, StanceSolver
from robots.model_import.tree import find_tree
from robots.quaternion import Array
from robots.validation import shown

SOLES = ("l_sole", "r_sole")
NECK, IMU = "neck", "imu"
MARK = [0.005, 0.0, 0.0]  # m, the size of a site
EXTENSIONS = (0.94, 0.9, 0.86, 0.82, 0.78, 0.7)
"""Shares of the stretched leg that are tried for the stance, in turn."""
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
    source, notes = read_model(path), []
    tree = find_tree(source, notes)
    anatomy = find_anatomy(tree, path, notes)
    unknown = [name for name in options.fixed if name not in [h.name for h in tree.hinges]]
    if unknown:
        listed = ", ".join(hinge.name for hinge in tree.hinges)
        raise ImportFault([f"--fix is {shown(name)}, expected one of {listed}" for name in unknown])
    spec = Rebuilder(
        anatomy, keep_hulls=options.keep_hulls, fixed=options.fixed, notes=notes
    ).build(options.name)
    return _Import(source, anatomy, spec, options, notes).finish()


class _Import:
    """One import, from the rebuilt model on."""

    def __init__(
        self,
        source: ModelSource,
        anatomy: Anatomy,
        spec: mujoco.MjSpec,
        options: ImportOptions,
        notes: list[str],
    ) -> None:
        self._source, self._anatomy, self._spec = source, anatomy, spec
        self._options, self._notes, self._guesses = options, notes, []
        self._kept = [
            k for k, hinge in enumerate(anatomy.tree.hinges) if hinge.name not in options.fixed
        ]
        self._model = self._compile()

    def finish(self) -> ImportedRobot:
        """Find all the rest."""
        start = self._start_angles()
        self._add_sites(start)
        self._model = self._compile()
        body = self._describe_body()
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

    def _look(self, angles: Array) -> mujoco.MjData:
        data = mujoco.MjData(self._model)
        data.qpos[7:] = angles
        mujoco.mj_kinematics(self._model, data)
        mujoco.mj_comPos(self._model, data)
        return data

    def _add_sites(self, start: Array) -> None:
        data = self._look(start)
        found = [self._find_sole(leg, data) for leg in self._anatomy.legs]
        for sole, name in zip(found, SOLES, strict=True):
            add_sole_site(self._spec, self._model.body(sole.body).name, sole, name)
        torso = self._model.body(1)
        neck, where = self._find_neck(data)
        self._spec.body(torso.name).add_site(name=NECK, pos=neck.tolist(), size=MARK)
        self._guesses.append(
            f"site {NECK}: at {where}; move it in model.xml if that is not the neck's base"
        )
        self._add_imu()

    def _add_imu(self) -> None:
        """Add the IMU's site: where the model has one on the torso, else at its origin."""
        tree, torso = self._anatomy.tree, self._spec.body(self._model.body(1).name)
        for site in range(tree.model.nsite):
            name = tree.model.site(site).name
            if tree.model.site_bodyid[site] == tree.root and _names_an_imu(name):
                position = tree.data.site_xpos[site] - tree.data.xpos[tree.root]
                axes = self._anatomy.axes.T @ tree.data.site_xmat[site].reshape(3, 3)
                orientation = np.zeros(4)
                mujoco.mju_mat2Quat(orientation, axes.ravel())
                position = self._anatomy.axes.T @ position
                torso.add_site(
                    name=IMU, pos=position.tolist(), quat=orientation.tolist(), size=MARK
                )
                self._guesses.append(f"site {IMU}: the model's site {name}")
                return
        torso.add_site(name=IMU, size=MARK)
        self._guesses.append(
            f"site {IMU}: at the origin of {torso.name}, its axes those of the torso; place it in "
            "model.xml"
        )

    def _find_sole(self, leg: Sequence[int], data: mujoco.MjData) -> Sole:
        hinges = self._anatomy.tree.hinges
        for hinge in reversed(leg):  # a toe that is smaller than the foot is no sole
            names = [
                self._anatomy.tree.model.body(b).name or f"body_{b}"
                for b in self._anatomy.tree.link(hinge)
            ]
            bodies = [self._model.body(name).id for name in names]
            sole = find_sole(self._model, data, bodies)
            if sole is not None:
                return sole
        raise ImportFault(
            [
                f"{self._source.path}: the leg that ends in joint "
                f"{shown(hinges[leg[-1]].name)} has no flat face that looks down, expected a sole"
            ]
        )

    def _find_neck(self, data: mujoco.MjData) -> tuple[Array, str]:
        """Return the place of the neck in the torso's frame, and what it is."""
        head = [self._place(k) for k in self._anatomy.head]
        head = [k for k in head if k is not None]
        shoulders = [self._place(left[0]) for left, _ in self._anatomy.arms]
        shoulders = [k for k in shoulders if k is not None]
        if head:
            anchor = data.xanchor[head[0] + 1].copy()
            anchor[1] = 0.0
            return anchor, f"joint {self._hinge_name(head[0])}"
        if shoulders:
            anchors = data.xanchor[[k + 1 for k in shoulders]]
            top = anchors[np.argmax(anchors[:, 2])].copy()
            top[1] = 0.0
            return top, "the middle of the shoulders"
        return np.array([0.0, 0.0, float(data.xipos[1, 2])]), "the torso's center of mass"

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
        """Spread the arms until they touch nothing that is far from them."""
        for spread in SPREADS:
            tried = solver.solve(extension, spread)
            arms = self._arm_bodies()
            overlaps = find_overlaps(self._model, tried.joint_pos)
            if tried.is_solved and not any(set(pair) & arms for pair in overlaps):
                return tried
        return stance

    def _arm_bodies(self) -> set[int]:
        links = [k for pair in self._anatomy.arms for limb in pair for k in limb[1:]]
        names = [h for k in links for h in self._anatomy.tree.link(k)]
        model = self._anatomy.tree.model
        return {self._model.body(model.body(b).name or f"body_{b}").id for b in names}

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
        data = self._look(stance.joint_pos)
        across = [k for k in body.legs[0] if abs(data.xaxis[k + 1][1]) > TWIST]
        knee = across[len(across) // 2] if across else body.legs[0][-1]
        rolls = [
            k
            for k in body.legs[0]
            if k < knee and abs(data.xaxis[k + 1][0]) > TWIST and body.mirror.index[k] != k
        ]
        return tuple(self._hinge_name(k) for k in rolls[:1])


def _names_an_imu(name: str) -> bool:
    return any(word in name.lower() for word in ("imu", "gyro"))
