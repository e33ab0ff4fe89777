"""The kinematic tree of a model: its hinges in one pose."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import mujoco
import numpy as np

from robots.body.parts import gather_links
from robots.description.model_checks import HINGE, JOINT_KINDS
from robots.model_import.source import MOST_INERTIA, ModelImportError, ModelSource
from robots.quaternion import Array
from robots.storage.validation import shown

SPANS = (0.1, 3.0)  # m from the lowest to the highest joint; others are of another unit
MASSES = (0.1, 500.0)  # kg
FREE_BASES = (("hinge",) * 3 + ("slide",) * 3, ("ball",) + ("slide",) * 3)
"""Kinds of joints that are together as free as a free joint, in alphabetical order."""
WORLD = 0


@dataclass(frozen=True, eq=False)
class Hinge:
    """A hinge in one pose of a model."""

    id: int
    name: str
    body: int
    """Body that it moves."""
    anchor: Array
    """A point on its axis, in the world [m], (3,)."""
    axis: Array
    """Unit vector in the world, (3,)."""
    parent: int
    """Place of the hinge above it in the tree's list; -1: the root."""


class KinematicTree:
    """The part of a model that is the robot: a root body and all below it, in one pose."""

    def __init__(self, model: mujoco.MjModel, root: int, qpos: Array) -> None:
        self.model, self.root = model, root
        self.data = mujoco.MjData(model)
        self.data.qpos[:] = qpos
        mujoco.mj_kinematics(model, self.data)
        mujoco.mj_comPos(model, self.data)
        self.torso = gather_links(model, root)
        self.bodies = self.torso.list_bodies()

    @cached_property
    def hinges(self) -> list[Hinge]:
        """Return the hinges below the root, parents before children."""
        model, data = self.model, self.data
        below = [
            joint for link in self.torso.walk() for joint in link.joints if link.root != self.root
        ]
        ids = [joint for joint in below if model.jnt_type[joint] == HINGE]
        places = {joint: k for k, joint in enumerate(sorted(ids))}
        return [
            Hinge(
                id=joint,
                name=name_joint(model, joint),
                body=int(model.jnt_bodyid[joint]),
                anchor=data.xanchor[joint].copy(),
                axis=data.xaxis[joint].copy(),
                parent=places.get(self._find_above(joint), -1),
            )
            for joint in places
        ]

    def _find_above(self, joint: int) -> int:
        """Find the joint above another one; -1 if there is none in the tree."""
        body = int(self.model.jnt_bodyid[joint])
        if joint > self.model.body_jntadr[body]:
            return joint - 1
        while body != self.root:
            body = int(self.model.body_parentid[body])
            if count := int(self.model.body_jntnum[body]):
                return int(self.model.body_jntadr[body]) + count - 1
        return -1

    def chain(self, hinge: int) -> list[int]:
        """Return the places of the hinges from the root down to one of them."""
        chain = [hinge]
        while self.hinges[chain[-1]].parent >= 0:
            chain.append(self.hinges[chain[-1]].parent)
        return chain[::-1]

    @cached_property
    def leaves(self) -> list[int]:
        """Return the places of the hinges that carry no other."""
        parents = {hinge.parent for hinge in self.hinges}
        return [k for k in range(len(self.hinges)) if k not in parents]

    def link(self, hinge: int) -> list[int]:
        """Return the bodies that a hinge moves but no hinge below it."""
        root = self.hinges[hinge].body
        return next(link.bodies for link in self.torso.walk() if link.root == root)


def name_joint(model: mujoco.MjModel, joint: int) -> str:
    """Return the name of a joint; one without a name is called after its body."""
    own = model.joint(joint).name
    body = int(model.jnt_bodyid[joint])
    if own:
        return own
    number = joint - int(model.body_jntadr[body])
    return model.body(body).name + (f"_{number}" if number else "") or f"joint_{joint}"


def find_tree(source: ModelSource, notes: list[str]) -> KinematicTree:
    """Find the robot in a model, in the stance of a keyframe if there is one; notes are added."""
    model, path = source.model, source.path
    tops = [body for body in range(1, model.nbody) if model.body_parentid[body] == WORLD]
    below = {top: gather_links(model, top).list_bodies() for top in tops}
    is_hinge = model.jnt_type == HINGE
    count = {top: int(np.sum(is_hinge & np.isin(model.jnt_bodyid, below[top]))) for top in tops}
    if not tops or max(count.values()) == 0:
        raise ModelImportError(f"{path}: it has no hinges, expected those of a humanoid")
    root = max(tops, key=lambda top: count[top])
    while _is_frame(model, root):
        root = next(b for b in range(root + 1, model.nbody) if model.body_parentid[b] == root)
    problems = [*_find_joint_problems(source, root, notes), *_find_size_problems(source, root)]
    if problems:
        raise ModelImportError(*problems)
    qpos = model.qpos0.copy()
    for joint in range(model.njnt):
        if model.jnt_type[joint] == HINGE and model.joint(joint).name in source.stance:
            qpos[model.jnt_qposadr[joint]] = source.stance[model.joint(joint).name]
    return KinematicTree(model, root, qpos)


def _is_frame(model: mujoco.MjModel, body: int) -> bool:
    """Tell whether a body is an empty frame around one other body."""
    children = np.flatnonzero(model.body_parentid == body)
    is_empty = model.body_jntnum[body] == 0 and model.body_geomnum[body] == 0
    return bool(is_empty and model.body_mass[body] == 0.0 and len(children) == 1)


def _find_joint_problems(source: ModelSource, root: int, notes: list[str]) -> Iterator[str]:
    model = source.model
    own = [j for j in range(model.njnt) if model.jnt_bodyid[j] == root]
    kinds = [JOINT_KINDS[int(model.jnt_type[j])] for j in own]
    is_floating = kinds == ["free"]
    if tuple(sorted(kinds)) in FREE_BASES:
        turns = "ball" if "ball" in kinds else "three hinges"
        notes.append(f"the root's three slides and {turns} are replaced by a free joint")
    elif not kinds and not source.is_floating:
        notes.append(f"body {shown(model.body(root).name)} was fixed to the world: it floats now")
    elif kinds and not is_floating:
        held = ", ".join(
            f"{JOINT_KINDS[int(model.jnt_type[j])]} {shown(name_joint(model, j))}" for j in own
        )
        yield (
            f"{source.path}: torso {shown(model.body(root).name)} hangs on the world by {held}, "
            "expected a free joint or none"
        )
    for body in gather_links(model, root).list_bodies()[1:]:
        for joint in range(model.njnt):
            if model.jnt_bodyid[joint] == body and model.jnt_type[joint] != HINGE:
                kind = JOINT_KINDS[int(model.jnt_type[joint])]
                yield (
                    f"{source.path}: joint {shown(name_joint(model, joint))} of body "
                    f"{shown(model.body(body).name)} is a {kind} joint, "
                    "expected hinges: model it as hinges, or fix it"
                )


def _find_size_problems(source: ModelSource, root: int) -> Iterator[str]:
    model = source.model
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    bodies = gather_links(model, root).list_bodies()
    span = float(np.ptp(data.xpos[bodies, 2]))
    mass = float(model.body_mass[bodies].sum())
    for body in bodies:
        if (moment := float(model.body_inertia[body].max())) > MOST_INERTIA:
            yield (
                f"{source.path}: body {shown(model.body(body).name)} has an inertia of "
                f"{moment:g} kg·m², expected at most {MOST_INERTIA:g} kg·m²"
            )
        first, count = int(model.body_geomadr[body]), int(model.body_geomnum[body])
        own = slice(first, first + count)  # its shapes; planes have no radius
        reach = np.linalg.norm(model.geom_pos[own], axis=1) + model.geom_rbound[own]
        if span <= SPANS[1] and (far := float(reach.max(initial=0.0))) > SPANS[1]:
            yield (
                f"{source.path}: a shape of body {shown(model.body(body).name)} reaches "
                f"{far:.3g} m from it, expected at most {SPANS[1]:g} m: a mesh in mm needs scale "
                "0.001"
            )
    if not SPANS[0] <= span <= SPANS[1]:
        is_mm = SPANS[0] <= span / 1e3 <= SPANS[1]
        hint = "these look like mm" if is_mm else "and z points up"
        yield (
            f"{source.path}: its joints span {span:.3g} m of height, expected {SPANS[0]:g} to "
            f"{SPANS[1]:g} m: lengths are in m, {hint}"
        )
    if not MASSES[0] <= mass <= MASSES[1]:
        yield (
            f"{source.path}: its mass is {mass:.3g} kg, expected {MASSES[0]:g} to {MASSES[1]:g} "
            "kg: masses are in kg"
        )
