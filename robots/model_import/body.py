"""The body of a rebuilt model: what its hinges are, and where its sides contradict each other."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import mujoco
import numpy as np

from robots.body.mirror_pairs import Mirror
from robots.model_import.rebuilt import RebuiltModel
from robots.quaternion import Array

LEAST_ROOM = 0.2  # share of a joint's range that the range of its mirror joint must leave


@dataclass(frozen=True, eq=False, kw_only=True)
class Body:
    """A floating model and which of its n hinges, in the model's order, are what."""

    model: mujoco.MjModel
    mirror: Mirror
    legs: tuple[tuple[int, ...], tuple[int, ...]]
    """Hinges of the left and of the right leg, from the hip down."""
    arms: tuple[tuple[tuple[int, ...], tuple[int, ...]], ...]
    """Hinges of pairs of arms, left and right."""
    soles: tuple[str, str]
    """Sites of the left and the right sole."""

    @property
    def lower(self) -> Array:
        """Return the lower joint limits [rad], (n,)."""
        return self.model.jnt_range[1:, 0]

    @property
    def upper(self) -> Array:
        """Return the upper joint limits [rad], (n,)."""
        return self.model.jnt_range[1:, 1]


def describe_body(rebuilt: RebuiltModel, soles: tuple[str, str]) -> Body:
    """Describe a rebuilt model by the anatomy of its tree; a joint without its mirror has none."""
    anatomy, kept = rebuilt.anatomy, rebuilt.tree_hinges
    left_leg, right_leg = (rebuilt.find(leg) for leg in anatomy.legs)
    arms = [(rebuilt.find(left), rebuilt.find(right)) for left, right in anatomy.arms]
    mirrors = [rebuilt.find([int(anatomy.mirror.index[k])]) for k in kept]
    index = [mirror[0] if mirror else i for i, mirror in enumerate(mirrors)]
    return Body(
        model=rebuilt.model,
        mirror=Mirror(np.array(index), anatomy.mirror.sign[kept], ()),
        legs=(left_leg, right_leg),
        arms=tuple((left, right) for left, right in arms if left and right),
        soles=soles,
    )


def find_contradictions(body: Body) -> Iterator[str]:
    """Find pairs of which one can only turn to where the other cannot."""
    for k, other in enumerate(body.mirror.index):
        images = body.mirror.sign[k] * np.array([body.lower[other], body.upper[other]])
        room = min(body.upper[k], images.max()) - max(body.lower[k], images.min())
        widest = min(body.upper[k] - body.lower[k], np.ptp(images))
        if k < other and room < LEAST_ROOM * widest:
            one, two = (body.model.joint(hinge + 1).name for hinge in (k, int(other)))
            yield (
                f"joints {one} and {two} mirror each other, but not their ranges, "
                f"{_range(body, k)} and {_range(body, int(other))}: the model has a wrong axis "
                "or range there; correct it"
            )


def _range(body: Body, hinge: int) -> str:
    lower, upper = np.degrees([body.lower[hinge], body.upper[hinge]])
    return f"{lower:.0f} to {upper:.0f} deg"
