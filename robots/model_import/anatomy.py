"""Anatomy: which hinges of a tree are legs, arms and head, and where its front is."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from robots.body.parts import BodyParts, Link, sort_parts
from robots.body.sides import MirrorPairs, find_mirror, side_of
from robots.model_import.source import ModelImportError
from robots.model_import.tree import KinematicTree
from robots.quaternion import Array
from robots.storage.validation import shown

LEVEL = 0.1  # share of the height by which the lowest ends of two legs may differ
PARALLEL = 0.02  # share of the heaviest end's mass below which a limb is a rod beside a leg
LEAST_WIDTH = 0.02  # share of the height from which two feet are apart
HIGH_HIP = 0.1  # share of the height by which hips may be above the rest's center of mass
LEAST_LEG = 3  # hinges of a leg that can squat: hip, knee, ankle
NEAR_AXIS = np.cos(np.radians(1.0))  # feet are that precisely beside each other
ALONG = 0.7  # cosine from which an axis counts as parallel to a direction
LEAST_TOE = 0.01  # share of the height by which a sole is longer in front of the ankle
LOW_HEAD = 0.1  # share of the height by which a neck may be below the shoulders
LEAST_BEND = 0.5  # rad by which a knee turns farther backwards
UP = np.array([0.0, 0.0, 1.0])
Legs = tuple[tuple[int, ...], tuple[int, ...]]


@dataclass(frozen=True, eq=False)
class Anatomy:
    """Parts of a humanoid; hinges are indices into the tree's list."""

    tree: KinematicTree
    axes: Array
    """Forward, left and up in the world, in columns, (3, 3)."""
    middle: Array
    """A point of the plane of symmetry in the world [m], (3,)."""
    legs: Legs
    """Hinges of the left and the right leg alone, from the hip down."""
    mirror: MirrorPairs
    height: float
    """From the lowest to the highest point [m]."""

    def local(self, points: Array) -> Array:
        """Convert points of the world to forward, left, up from the middle [m], (..., 3)."""
        return (points - self.middle) @ self.axes

    @cached_property
    def anchors(self) -> Array:
        """Return the hinges' places: forward, left, up [m], (n, 3)."""
        return self.local(np.array([hinge.anchor for hinge in self.tree.hinges]))

    @cached_property
    def _parts(self) -> BodyParts:
        """Sort the links by the known feet; a limb that is its own mirror image may be a head."""
        places = {hinge.id: k for k, hinge in enumerate(self.tree.hinges)}
        feet = {self.tree.hinges[leg[-1]].body for leg in self.legs}
        return sort_parts(
            self.tree.torso,
            is_foot=lambda link: link.root in feet,
            is_head=lambda link: all(
                self.mirror.index[places[joint]] == places[joint]
                for part in link.walk()
                for joint in part.joints
            ),
            aside=lambda link: float(self.anchors[places[link.joints[0]]][1]),
        )

    @cached_property
    def arms(self) -> tuple[tuple[tuple[int, ...], tuple[int, ...]], ...]:
        """Return pairs of limbs, left and right, that are not legs; each to its longest end."""
        index = self.mirror.index
        chains = [self._list_longest(arm) for _, arm in self._parts.arms]
        left = [chain for chain in chains if chain and self.anchors[chain[-1]][1] > 0.0]
        return tuple((chain, tuple(int(index[k]) for k in chain)) for chain in left)

    @cached_property
    def head(self) -> tuple[int, ...]:
        """Return the hinges in the middle whose limb ends above the shoulders."""
        shoulders = [self.anchors[left[0]][2] for left, _ in self.arms]
        floor = max(shoulders, default=0.0) - LOW_HEAD * self.height
        heads = [
            {joint for part in head.walk() for joint in part.joints}
            for _, head in self._parts.heads
        ]
        found = [[k for k, h in enumerate(self.tree.hinges) if h.id in head] for head in heads]
        return tuple(sorted(k for own in found if self.anchors[own[0]][2] >= floor for k in own))

    def _list_longest(self, limb: Link) -> tuple[int, ...]:
        """List the hinges with a counterpart on the longest way through a limb."""
        below = {part.root for part in limb.walk()}
        chains = [
            [
                k
                for k in self.tree.chain(leaf)
                if self.tree.hinges[k].body in below and self.mirror.index[k] != k
            ]
            for leaf in self.tree.leaves
        ]
        return tuple(max(chains, key=len))


def find_anatomy(tree: KinematicTree, path: Path, notes: list[str]) -> Anatomy:
    """Find the parts of a humanoid that stands upright, z up, in a tree's pose, with notes."""
    ends = [_measure_link(tree, k, UP) or (h.anchor[2],) * 2 for k, h in enumerate(tree.hinges)]
    low, high = np.array(ends).T
    height = float(np.nanmax(high) - np.nanmin(low))
    one, other = _find_feet(tree, low, height, path)
    _check_hips(tree, _find_legs(tree, one, other), height, path)
    apart = tree.hinges[one].anchor - tree.hinges[other].anchor
    apart[2] = 0.0
    lateral = _snap(apart / np.linalg.norm(apart), tree)
    left, right, axes = _turn_forward(tree, one, other, lateral, height, notes)
    legs = _find_legs(tree, left, right)
    middle = np.mean([tree.hinges[leg[0]].anchor for leg in legs], axis=0)
    mirror = find_mirror(
        [hinge.name for hinge in tree.hinges],
        (np.array([hinge.anchor for hinge in tree.hinges]) - middle) @ axes,
        np.array([hinge.axis for hinge in tree.hinges]) @ axes,
        (tree.data.subtree_com[[hinge.body for hinge in tree.hinges]] - middle) @ axes,
        [len(tree.chain(k)) for k in range(len(tree.hinges))],
        height,
    )
    for k in mirror.unpaired:
        notes.append(f"joint {shown(tree.hinges[k].name)} has no counterpart: it is its own mirror")
    return Anatomy(tree=tree, axes=axes, middle=middle, legs=legs, mirror=mirror, height=height)


def _measure_link(tree: KinematicTree, hinge: int, way: Array) -> tuple[float, float] | None:
    """Measure the extent of a hinge's link along a unit vector (3,), in the world [m]."""
    model, data = tree.model, tree.data
    geoms = np.flatnonzero(np.isin(model.geom_bodyid, tree.link(hinge)))
    if not len(geoms):
        return None
    rotation = data.geom_xmat[geoms].reshape(-1, 3, 3)
    center = data.geom_xpos[geoms] + np.einsum("gij,gj->gi", rotation, model.geom_aabb[geoms, :3])
    reach = np.sum(np.abs(way @ rotation) * model.geom_aabb[geoms, 3:], axis=1)
    along = center @ way
    return float(np.min(along - reach)), float(np.max(along + reach))


def _find_feet(tree: KinematicTree, low: Array, height: float, path: Path) -> tuple[int, int]:
    """Find the two lowest ends of limbs that are apart from each other."""
    mass = {k: tree.model.body_subtreemass[tree.hinges[k].body] for k in tree.leaves}
    heavy = [k for k in tree.leaves if mass[k] > PARALLEL * max(mass.values())]
    ends = sorted((k for k in heavy if len(tree.chain(k)) >= LEAST_LEG), key=lambda k: low[k])
    if not ends:
        raise ModelImportError(f"{path}: it has no limb of {LEAST_LEG} hinges, expected two legs")
    first = ends[0]
    for second in ends[1:]:
        shared = set(tree.chain(first)) & set(tree.chain(second))
        own = min(len(tree.chain(first)), len(tree.chain(second))) - len(shared)
        apart = tree.hinges[first].anchor - tree.hinges[second].anchor
        if own >= LEAST_LEG and np.hypot(*apart[:2]) > LEAST_WIDTH * height:
            if low[second] - low[first] > LEVEL * height:
                break
            return first, second
    raise ModelImportError(
        f"{path}: only the limb that ends in joint {shown(tree.hinges[first].name)} reaches "
        f"down to the ground, expected two legs of at least {LEAST_LEG} hinges, z up"
    )


def _check_hips(tree: KinematicTree, legs: Legs, height: float, path: Path) -> None:
    """Raise ModelImportError if the lowest limbs begin above the mass they carry, as arms do."""
    model, data = tree.model, tree.data
    below = {hinge for leg in legs for hinge in leg}
    carried = np.setdiff1d(tree.bodies, [body for hinge in below for body in tree.link(hinge)])
    center = np.average(data.xipos[carried, 2], weights=model.body_mass[carried] + 1e-9)
    hips = np.mean([tree.hinges[leg[0]].anchor[2] for leg in legs])
    if hips > center + HIGH_HIP * height:
        names = " and ".join(shown(tree.hinges[leg[0]].name) for leg in legs)
        raise ModelImportError(
            f"{path}: the lowest limbs begin with joints {names}, above the center of mass of "
            f"the rest, expected two legs of at least {LEAST_LEG} hinges, z up"
        )


def _find_legs(tree: KinematicTree, one: int, other: int) -> Legs:
    """Find the hinges of two limbs alone, by their last ones."""
    first, second = tree.chain(one), tree.chain(other)
    return tuple(k for k in first if k not in second), tuple(k for k in second if k not in first)


def _snap(direction: Array, tree: KinematicTree) -> Array:
    """Turn a direction to the nearest axis of the root body, or of the world, if close."""
    root = tree.data.xmat[tree.root].reshape(3, 3)
    for axes in (root, np.eye(3)):
        cosines = direction @ axes
        best = int(np.argmax(np.abs(cosines)))
        level = abs(axes[2, best]) < 1e-3
        if level and abs(cosines[best]) > NEAR_AXIS:
            return np.sign(cosines[best]) * axes[:, best]
    return direction


def _turn_forward(
    tree: KinematicTree, one: int, other: int, lateral: Array, height: float, notes: list[str]
) -> tuple[int, int, Array]:
    """Find the front by left and right names, else by the feet, longer before the ankle, or knees.

    Those bend so that the shanks go backwards. ``lateral`` leads from ``other`` to ``one``; return
    the ends of the left and the right leg, and the axes: forward, left, up, (3, 3).
    """
    named = side_of(tree.hinges[one].name) - side_of(tree.hinges[other].name)
    forward = np.cross(lateral, UP)  # if `one` is the left
    toe = np.mean([_measure_toe(tree, k, forward) for k in (one, other)])
    by_toes = np.sign(toe) if abs(toe) > LEAST_TOE * height else 0.0
    legs = _find_legs(tree, one, other)
    by_knees = np.sign(sum(_measure_bend(tree, leg, lateral) for leg in legs))
    sign = np.sign(named) or by_toes or by_knees or 1.0
    notes += _find_contradictions(sign, by_toes, by_knees)
    if not named and not by_toes and not by_knees:
        notes.append("neither names nor feet nor knees show where the front is: x is assumed")
        sign = 1.0 if forward[0] >= 0.0 else -1.0
    left, right = (one, other) if sign > 0.0 else (other, one)
    return left, right, np.column_stack([sign * forward, sign * lateral, UP])


def _find_contradictions(sign: float, by_toes: float, by_knees: float) -> Iterator[str]:
    """Say what stands against the front found; each is 1 or -1 for a front, or 0 for none."""
    feet, knees = by_toes == -sign, by_knees == -sign
    if feet and knees:
        yield (
            "feet and knees point backwards, going by left and right in the names: swap the names "
            "if the robot has its front there"
        )
    elif knees:
        yield (
            "the knees bend backwards: correct their ranges or axes in the model, unless the "
            "robot's do"
        )
    elif feet and not by_knees:
        yield (
            "the feet are longer behind the ankles, going by left and right in the names: swap "
            "the names if the robot has its front there"
        )


def _measure_bend(tree: KinematicTree, leg: tuple[int, ...], lateral: Array) -> float:
    """Measure how much farther a knee turns one way than the other [rad]; above 0 about left."""
    across = [k for k in leg if abs(tree.hinges[k].axis @ lateral) > ALONG]
    if len(across) < LEAST_LEG:
        return 0.0
    knee = tree.hinges[across[len(across) // 2]]
    if not tree.model.jnt_limited[knee.id]:
        return 0.0
    way = float(np.sign(knee.axis @ lateral) * tree.model.jnt_range[knee.id].sum())
    return way if abs(way) > LEAST_BEND else 0.0


def _measure_toe(tree: KinematicTree, hinge: int, forward: Array) -> float:
    """Measure how much longer a foot is in front of its ankle than behind [m]."""
    ends = _measure_link(tree, hinge, forward)
    if ends is None:
        return 0.0
    # A point on an axis that points forward may be anywhere along it.
    across = [k for k in tree.chain(hinge) if abs(tree.hinges[k].axis @ forward) < ALONG]
    ankle = tree.hinges[across[-1] if across else hinge].anchor @ forward
    return ends[0] + ends[1] - 2.0 * float(ankle)
