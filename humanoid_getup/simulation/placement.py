"""Placement: place and heading of a robot in a scene, which its sensors cannot measure."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from robots import Posture, quaternion
from robots.quaternion import Array

UPRIGHT = 0.7  # length of the spine's horizontal part from which it gives the heading


@dataclass(frozen=True, kw_only=True)
class Placement:
    """Place and heading of a robot in its scene."""

    x: float
    """Position of the torso [m]."""
    y: float
    heading: float
    """Horizontal direction in which the head of a lying robot points, or the front of an upright
    one [rad]; 0 is along +x."""

    @staticmethod
    def of(posture: Posture) -> Placement:
        """Return the placement of a posture."""
        x, y = posture.position[:2].tolist()
        return Placement(x=x, y=y, heading=measure_heading(posture.orientation))

    def turn(self, orientation: Array) -> Array:
        """Turn an orientation (4,) of unknown heading about the vertical to this heading."""
        turn = quaternion.from_yaw(self.heading - measure_heading(orientation))
        return quaternion.normalize(quaternion.multiply(turn, orientation))


def measure_heading(orientation: Array) -> float:
    """Measure the heading of a torso [rad], by its spine or, if that is upright, by its front."""
    spine = quaternion.rotate(orientation, np.array([0.0, 0.0, 1.0]))
    front = quaternion.rotate(orientation, np.array([1.0, 0.0, 0.0]))
    axis = spine if math.hypot(spine[0], spine[1]) > UPRIGHT else front
    return math.atan2(axis[1], axis[0])
