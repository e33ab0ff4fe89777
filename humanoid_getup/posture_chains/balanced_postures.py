"""Balanced postures: robots at rest on flat soles, or hands as well, and what holds them there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from robots import Posture, Robot
from robots.body.props import Prop
from robots.body.statics import Statics
from robots.quaternion import Array


@dataclass(frozen=True, kw_only=True, eq=False)
class BalancedPostures:
    """Postures on flat soles, or hands as well, and the targets with which servos hold them."""

    postures: tuple[Posture, ...]
    """On the ground z = 0, their soles level."""
    targets: Array
    """(K, n) [rad]"""

    @classmethod
    def at(cls, robot: Robot, joint_pos: Sequence[Array]) -> Self:
        """Set a robot at each of K joint angles (n,) [rad] on its soles."""
        return cls.of_props(robot, [Prop(joint_pos=angles) for angles in joint_pos])

    @classmethod
    def of_props(cls, robot: Robot, props: Sequence[Prop]) -> Self:
        """Set a robot on its soles and hands."""
        statics = Statics(robot)
        targets = [statics.find_targets(each.joint_pos, each.hands, each.share) for each in props]
        return cls(
            postures=tuple(statics.make_posture(each.joint_pos) for each in props),
            targets=np.array(targets).reshape(-1, robot.n),
        )

    def __len__(self) -> int:
        return len(self.postures)
