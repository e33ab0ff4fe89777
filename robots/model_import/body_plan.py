"""The plan of a body: which hinges are legs, arms and head, mirror pairs, and what they are for."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import mujoco
import numpy as np

from robots.body.joint_view import JointView
from robots.body.limbs import WHOLE, Leg
from robots.body.sides import MirrorPairs
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


BENDING = 3  # joints of an arm that a learned rise moves


def list_segments(body: BodyPlan, angles: Array) -> tuple[str, ...]:
    """List the segment of each joint: head, foot for those below the knee, or other.

    Which ones bend the legs is seen at joint angles (n,) [rad].
    """
    body.view.look(angles)
    segments = ["other"] * len(angles)
    for k in body.head:
        segments[k] = "head"
    for leg in body.legs:
        across = body.view.list_pitch(leg)
        for k in leg[leg.index(_middle(across)) + 1 :] if len(across) >= WHOLE else ():
            segments[k] = "foot"
    return tuple(segments)


def list_rising(body: BodyPlan, stance: Array) -> tuple[str, ...]:
    """List hips, knees, ankles, and three joints of an arm that do not twist it in the stance."""
    view = body.view
    view.look(stance)
    rising: list[int] = []
    for left, _ in body.arms[:1]:
        end = view.end(left[-1])
        rising += [k for k in left if not view.twists(k, end - view.anchor(k))][:BENDING]
    return _list_paired(body, [*rising, *body.left_leg.list_pitch()])


def list_spreading(body: BodyPlan, stance: Array) -> tuple[str, ...]:
    """List the hinge of the leg above the knee that rolls it most, at joint angles [rad], (n,)."""
    body.view.look(stance)
    leg, across = body.legs[0], body.left_leg.list_pitch()
    knee = _middle(across) if across else leg[-1]
    hip = [k for k in leg if k < knee and k not in across] or [leg[0]]
    return _list_paired(body, [max(hip, key=lambda k: abs(body.view.axis(k)[0]))])


def _list_paired(body: BodyPlan, hinges: Sequence[int]) -> tuple[str, ...]:
    """List hinges that have a mirror image; the two sides of a robot may differ."""
    return tuple(body.joint_names[k] for k in hinges if body.mirror.index[k] != k)


def _middle(hinges: Sequence[int]) -> int:
    return hinges[len(hinges) // 2]
