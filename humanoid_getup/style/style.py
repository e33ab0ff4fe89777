"""A style: curves for one or several ways of lying; a rise follows the nearest."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from humanoid_getup.style.curves import StyleCurves
from humanoid_getup.style.features import angle_distance
from robots.quaternion import Array

ALIKE = np.radians(5.0)  # by which the beginnings of curves may differ that are nearly alike


@dataclass(frozen=True, kw_only=True, eq=False)
class Style:
    """A named way of rising."""

    name: str
    about: str = ""
    """What it is, in one line."""
    curves: tuple[StyleCurves, ...]
    """One for each way of lying; their mirror images belong to them."""

    def __post_init__(self) -> None:
        if not self.curves:
            raise ValueError(f"style '{self.name}' has no curves, expected one or more")

    def choose(self, features: Array) -> StyleCurves:
        """Choose the curves, or their mirror image, that begin nearest to measured features (3,).

        Among those that begin nearly alike, the ones that turn the torso least are chosen.
        """
        return self._choices[0][self._find(features)]

    def find(self, features: Array) -> tuple[int, bool]:
        """Find the number of the curves that are chosen, and whether it is their mirror image."""
        number = self._find(features)
        return number % len(self.curves), number >= len(self.curves)

    def _find(self, features: Array) -> int:
        _, begins, turns = self._choices
        distance = angle_distance(begins, features)
        return int(np.argmin(np.where(distance <= distance.min() + ALIKE, turns, np.inf)))

    @cached_property
    def _choices(self) -> tuple[list[StyleCurves], Array, Array]:
        """All curves and mirror images, with their beginnings, (m, 3), and turns, (m,).

        They are kept, because a robot chooses within a control cycle.
        """
        every = [*self.curves, *(curve.mirrored() for curve in self.curves)]
        begins = np.array([curve.points[0] for curve in every])
        return every, begins, np.array([round(curve.turn, 6) for curve in every])
