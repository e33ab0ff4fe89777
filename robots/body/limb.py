"""A limb of a robot: its joints from the torso on, and where its parts point."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from robots.quaternion import Array

LimbName = Literal["left_arm", "right_arm", "left_leg", "right_leg"]
LIMB_NAMES: tuple[LimbName, ...] = ("left_arm", "right_arm", "left_leg", "right_leg")
LEGS: tuple[LimbName, LimbName] = ("left_leg", "right_leg")
ARMS: tuple[LimbName, LimbName] = ("left_arm", "right_arm")


@dataclass(frozen=True, eq=False)
class LimbPose:
    """Where the parts of a limb point, in the torso's frame."""

    upper: Array
    """Unit vector along upper arm or thigh, away from the torso, (3,)."""
    lower: Array
    """Unit vector along forearm or shank, (3,)."""
    foot: Array | None = None
    """Forward, left and up of a sole, in columns, (3, 3); None for an arm."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Limb:
    """A limb of a robot; joints are places in the robot's order."""

    name: LimbName
    joints: tuple[int, ...]
    """All of its joints, from the torso on."""
    start: int
    """Joint at whose anchor its upper part begins."""
    middle: int
    """Joint at whose anchor the upper part ends and the lower one begins: elbow or knee."""
    end: int | None
    """Joint at whose anchor the lower part ends: ankle or wrist; None where the limb ends there."""
    sole: int | None
    """Site of its sole; None for an arm."""
