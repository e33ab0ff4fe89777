"""The plan of a body: which hinges belong to legs, arms and head, and which are mirror pairs."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import mujoco
import numpy as np

from robots.body.joint_view import JointView
from robots.body.leg import Leg
from robots.body.mirror_pairs import MirrorPairs
from robots.quaternion import Array

LEAST_ROOM = 0.2  # share of a joint's range that the range of its mirror joint must leave


@dataclass(frozen=True, eq=False, kw_only=True)
class BodyPlan:
    """A floating model and the roles of its n hinges, in the model's order."""

    model: mujoco.MjModel
    mirror: MirrorPairs
    legs: tuple[tuple[int, ...], tuple[int, ...]]
    """Hinges of the left and of the right leg, from the hip down."""
    arms: tuple[tuple[tuple[int, ...], tuple[int, ...]], ...]
    """Hinges of pairs of arms, left and right."""
    head: tuple[int, ...]
    soles: tuple[str, str]
    """Sites of the left and the right sole."""
    passive: tuple[str, ...] = ()
    """Further hinges, which follow these."""

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Return the names of the hinges."""
        return tuple(self.model.joint(joint).name for joint in self.view.ids)

    @property
    def lower(self) -> Array:
        """Return the lower joint limits [rad], (n,)."""
        return self.model.jnt_range[self.view.ids, 0]

    @property
    def upper(self) -> Array:
        """Return the upper joint limits [rad], (n,)."""
        return self.model.jnt_range[self.view.ids, 1]

    @cached_property
    def view(self) -> JointView:
        """Return a view of the hinges; passive ones follow them."""
        hinges = np.flatnonzero(self.model.jnt_type == mujoco.mjtJoint.mjJNT_HINGE).tolist()
        active = [k for k in hinges if self.model.joint(k).name not in self.passive]
        return JointView(self.model, active, self.passive)

    @cached_property
    def left_leg(self) -> Leg:
        """Return the left leg in that view."""
        return Leg(self.view, self.legs[0], self.model.site(self.soles[0]).id)

    def find_contradictions(self) -> Iterator[str]:
        """Find mirror pairs whose joint ranges contradict each other."""
        lower, upper = self.lower, self.upper
        for k, other in enumerate(self.mirror.index):
            images = self.mirror.sign[k] * np.array([lower[other], upper[other]])
            room = min(upper[k], images.max()) - max(lower[k], images.min())
            widest = min(upper[k] - lower[k], np.ptp(images))
            if k < other and room < LEAST_ROOM * widest:
                one, two = self.joint_names[k], self.joint_names[other]
                yield (
                    f"joints {one} and {two} mirror each other, but not their ranges, "
                    f"{self._range(k)} and {self._range(int(other))}: the model has a wrong axis "
                    "or range there; correct it"
                )

    def _range(self, hinge: int) -> str:
        lower, upper = np.degrees([self.lower[hinge], self.upper[hinge]])
        return f"{lower:.0f} to {upper:.0f} deg"
