"""A limb of a robot: its joints from the torso on, where its parts point, and a leg's measures."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from robots.body.joint_view import JointView
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


BEND = 0.6  # rad by which knees are bent before a search
WHOLE = 3  # pitch joints of a leg that can squat: hip, knee, ankle


@dataclass(frozen=True, eq=False)
class Leg:
    """A leg, measured at the angles that the view looked at last, in the torso's frame."""

    view: JointView
    joints: tuple[int, ...]
    """Places of its joints, from the hip down."""
    sole: int
    """Site of its sole."""

    @property
    def hip(self) -> Array:
        """Return the position of its first joint [m], (3,)."""
        return self.view.anchor(self.joints[0])

    @property
    def sole_position(self) -> Array:
        """Return the position of its sole [m], (3,)."""
        return self.view.data.site_xpos[self.sole].copy()

    @property
    def sole_axes(self) -> Array:
        """Return forward, left and up of its sole, in columns, (3, 3)."""
        return self.view.data.site_xmat[self.sole].reshape(3, 3).copy()

    def list_pitch(self) -> list[int]:
        """List the joints that bend it forward and back."""
        return self.view.list_pitch(self.joints)

    def measure_stretched(self) -> float:
        """Measure the way from the hip to the sole through the joints that bend it [m].

        The hip's width does not count.
        """
        points = [self.hip, *map(self.view.anchor, self.list_pitch()), self.sole_position]
        flat = np.array(points)[:, [0, 2]]
        return float(np.linalg.norm(np.diff(flat, axis=0), axis=1).sum())

    def bend_knee(self, angles: Array, way: float) -> None:
        """Bend the knee in joint angles (n,), in place, so that hip, shank and foot follow.

        Args:
            angles: [rad]
            way: 1 for a knee that goes forward, -1 for one that goes back.
        """
        pitch = self.list_pitch()
        if len(pitch) >= WHOLE:
            hip, knee, ankle = pitch[0], pitch[len(pitch) // 2], pitch[-1]
            for k, share in ((hip, -0.5), (knee, 1.0), (ankle, -0.5)):
                angles[k] += way * BEND * share * np.sign(self.view.axis(k)[1])

    def measure_knee_lead(self) -> float:
        """Measure how far the knee is in front of the line from hip to ankle [m]."""
        pitch = self.list_pitch()
        if len(pitch) < WHOLE:
            return 0.0
        hip, knee, ankle = (self.view.anchor(pitch[i]) for i in (0, len(pitch) // 2, -1))
        share = (hip[2] - knee[2]) / max(hip[2] - ankle[2], 1e-6)
        return float(knee[0] - hip[0] - share * (ankle[0] - hip[0]))
