"""Left and right: names of sides, hinges that mirror each other, and the pairs of a robot."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from robots.body.joint_view import JointView
from robots.quaternion import Array
from robots.robot import Robot

MIRROR = np.array([1.0, -1.0, 1.0])
"""Factors on the coordinates of a point reflected in the plane y = 0."""
MIRROR_AXIS = -MIRROR
"""Factors on the coordinates of an axis of rotation reflected there."""
FAR = 0.12  # share of the height; hinges farther from their mirror image are not a pair
ASKEW = np.cos(np.radians(35.0))
NAME_BONUS = 0.3


@dataclass(frozen=True, eq=False)
class MirrorPairs:
    """The counterpart of each of n hinges when left and right are exchanged."""

    index: np.ndarray
    """Counterpart of each hinge, (n,); a hinge in the middle is its own."""
    sign: Array
    """Sign of its angle there, (n,)."""
    unpaired: tuple[int, ...]
    """Hinges without a counterpart that are not in the middle."""


@dataclass(frozen=True, eq=False)
class MirrorImages:
    """How near the mirror image of each of n hinges is to each hinge."""

    apart: Array
    """Distance between the points on their axes [m], (n, n)."""
    along: Array
    """Cosine between the image's axis and the other's, (n, n)."""

    @classmethod
    def compare(cls, anchors: Array, axes: Array) -> MirrorImages:
        """Compare hinges by points [m] and axes, (n, 3) each; the plane of symmetry is y = 0."""
        return cls(_part(anchors), (axes * MIRROR_AXIS) @ axes.T)


def find_mirror(
    names: Sequence[str],
    anchors: Array,
    axes: Array,
    centers: Array,
    depths: Sequence[int],
    height: float,
) -> MirrorPairs:
    """Pair hinges by the positions and axes of their mirror images; names decide among equals.

    Args:
        names: Of the hinges.
        anchors: Points on their axes [m], (n, 3): x forward, y left, the plane of symmetry y = 0.
        axes: Unit vectors, (n, 3), in the same frame.
        centers: Centers of mass of all that each hinge moves [m], (n, 3), in the same frame; they
            tell hinges at one place apart, such as those of neck and clavicles.
        depths: Number of hinges above each.
        height: Of the robot [m], by which distances are measured.
    """
    images = MirrorImages.compare(anchors, axes)
    along = images.along
    apart = np.maximum(images.apart, 0.5 * _part(centers)) / height  # (n, n)
    deeper = np.abs(np.subtract.outer(depths, depths))
    cost = apart + 0.5 * (1.0 - np.abs(along)) + 0.02 * deeper
    swapped = np.array([swap_side(name) for name in names])
    named = (swapped[:, None] == np.array(names)) & ~np.eye(len(names), dtype=bool)  # (n, n)
    cost -= NAME_BONUS * named
    cost = cost + cost.T
    index, unpaired = np.full(len(names), -1), []
    for flat in np.argsort(cost, axis=None):
        j, k = divmod(int(flat), len(names))
        is_open = index[j] < 0 and index[k] < 0
        if is_open and (named[j, k] or (apart[j, k] < FAR and abs(along[j, k]) > ASKEW)):
            index[j], index[k] = k, j
    for j in np.flatnonzero(index < 0):
        index[j] = j
        unpaired.append(int(j))
    sign = np.where(along[np.arange(len(names)), index] < 0.0, -1.0, 1.0)
    return MirrorPairs(index, sign, tuple(unpaired))


def _part(points: Array) -> Array:
    """Measure how far the mirror image of each point is from each other one [m], (n, n)."""
    return np.linalg.norm((points * MIRROR)[:, None] - points[None], axis=-1)


WORD = re.compile(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])|[0-9]+")
LEFT, RIGHT = ("l", "left"), ("r", "right")
OPPOSITE = dict(zip(LEFT + RIGHT, RIGHT + LEFT, strict=True))


def swap_side(name: str) -> str:
    """Return the name of a part's counterpart: "left_knee" for "right_knee", "LKnee" for "RKnee".

    A name that says no side is returned as it is.
    """
    word = next((w for w in WORD.finditer(name) if w.group().lower() in OPPOSITE), None)
    if word is None:
        return name
    other = OPPOSITE[word.group().lower()]
    text = word.group()
    other = other.capitalize() if text[0].isupper() else other
    other = other.upper() if text.isupper() and len(text) > 1 else other
    return name[: word.start()] + other + name[word.end() :]


def side_of(name: str) -> int:
    """Return 1 if a name states left, -1 if it states right, else 0."""
    words = [w.group().lower() for w in WORD.finditer(name)]
    said = next((word for word in words if word in OPPOSITE), "")
    return int(said in LEFT) - int(said in RIGHT)


def remove_side(left: str, right: str) -> str:
    """Remove the side from the name of a left joint, if it has one."""
    side = find_side(left, right)
    if side is None:
        return left
    start, word = side
    before, after = left[:start], left[start + len(word) :]
    return before + after.lstrip("_-.") if after else before.rstrip("_-.")


def find_side(a: str, b: str) -> tuple[int, str] | None:
    """Find the one word, in lower case, and its place in ``a``, that tells a pair's sides."""
    words, others = list(WORD.finditer(a)), list(WORD.finditer(b))
    if len(words) != len(others):
        return None
    differ = [
        (word, other.group().lower())
        for word, other in zip(words, others, strict=True)
        if word.group() != other.group()
    ]
    if len(differ) != 1:
        return None
    word, other = differ[0][0].group().lower(), differ[0][1]
    is_all = len(word) == len(a)  # a joint named "l" has no other name
    return None if OPPOSITE.get(word) != other or is_all else (differ[0][0].start(), word)


SAME_PLACE = 0.001  # m; joints closer than this to the plane between them are on neither side


@dataclass(frozen=True)
class JointSides:
    """The mirrored pairs of a robot: the left joint of each, and a name without its side."""

    robot: Robot

    @cached_property
    def left(self) -> tuple[int, ...]:
        """Return the left joint of each pair, in the robot's joint order."""
        mirror = enumerate(self.robot.mirror_index.tolist())
        return tuple(sorted(self._choose_left(k, other) for k, other in mirror if k < other))

    @cached_property
    def by_name(self) -> dict[str, int]:
        """Return the left joint of each pair by its names: without its side, and in full."""
        short = {joint: self.name(joint) for joint in self.left}
        full = {self.robot.joint_names[joint]: joint for joint in self.left}
        return {name: joint for joint, name in short.items()} | full

    def name(self, left: int) -> str:
        """Return the name of a pair without a side, or the left joint's if that is ambiguous."""
        full = self.robot.joint_names[left]
        return full if self._shared[self._bare(left)] > 1 else self._bare(left)

    def _bare(self, left: int) -> str:
        names = self.robot.joint_names
        return remove_side(names[left], names[int(self.robot.mirror_index[left])])

    @cached_property
    def _shared(self) -> Counter[str]:
        return Counter([*map(self._bare, self.left), *self.robot.joint_names])

    def _choose_left(self, a: int, b: int) -> int:
        """Choose by name, else by position; the first one where neither decides."""
        names = self.robot.joint_names
        side = find_side(names[a], names[b])
        if side is not None:
            return a if side[1] in LEFT else b
        anchor, limb = self._sideways
        for y in (anchor, limb):
            if abs(y[a] - y[b]) > SAME_PLACE:
                return a if y[a] > y[b] else b
        return a

    @cached_property
    def _sideways(self) -> tuple[Array, Array]:
        """Return y of each joint's anchor and of its limb's center of mass in the stance [m]."""
        view = JointView.of(self.robot)
        view.look(self.robot.standing.joint_pos)
        bodies = view.model.jnt_bodyid[view.ids]
        return view.data.xanchor[view.ids, 1], view.data.subtree_com[bodies, 1]
