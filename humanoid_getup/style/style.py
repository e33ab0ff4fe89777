"""A style: curves for one or several ways of lying, of which a rise follows the nearest."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from humanoid_getup.style.curves import StyleCurves
from humanoid_getup.style.features import angle_distance
from robots.quaternion import Array

ALIKE = np.radians(5.0)  # by which the beginnings of curves may differ that are nearly alike


@dataclass(frozen=True, kw_only=True)
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
        every = list(self.curves)
        every += [curve.mirrored() for curve in self.curves]
        distance = np.array([angle_distance(curve.points[0], features) for curve in every])
        turn = np.array([round(curve.turn, 6) for curve in every])
        return every[int(np.argmin(np.where(distance <= distance.min() + ALIKE, turn, np.inf)))]
