"""Sides: the left joint of each mirrored pair, and the name of the pair."""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import dataclass
from functools import cached_property

from robots.body.joint_view import JointView
from robots.quaternion import Array
from robots.robot import Robot

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
