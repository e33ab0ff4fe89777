"""Sides: the left joint of each mirrored pair, and the name of the pair."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from functools import cached_property

from robots.body.joint_view import JointView
from robots.body.side_names import LEFT, find_side, remove_side
from robots.quaternion import Array
from robots.robot import Robot

SAME_PLACE = 0.001  # m; joints closer than this to the plane between them are on neither side


@dataclass(frozen=True)
class JointSides:
    """The mirrored pairs of a robot: the left joint of each, and a name without its side."""

    robot: Robot

    @cached_property
    def left(self) -> tuple[int, ...]:
        """Return the left joint of each pair, in the robot's joint order."""
        found = {min(pair): self._choose_left(*pair) for pair in self._pairs()}
        return tuple(sorted(found.values()))

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
        """Count the pairs that one name without side stands for, and full names of joints."""
        return Counter([*map(self._bare, self.left), *self.robot.joint_names])

    def _pairs(self) -> list[tuple[int, int]]:
        mirror = self.robot.mirror_index.tolist()
        return [(joint, other) for joint, other in enumerate(mirror) if joint < other]

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
