"""The posture of a robot: position and orientation of its root, and its joint angles."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robots import quaternion
from robots.quaternion import Array

UNIT_TOLERANCE = 1e-3
MAX_DISTANCE = 1000.0  # m from the origin; farther away, positions lose their digits


@dataclass(frozen=True, kw_only=True)
class Posture:
    """A posture {p, q, V} of [Lin12], section 4.1."""

    position: Array
    """Root position in the world [m], shape (3,)."""
    orientation: Array
    """Root orientation in the world, unit quaternion w x y z, shape (4,)."""
    joint_pos: Array
    """Joint angles [rad], shape (n,), in the robot's joint order."""

    def __post_init__(self) -> None:
        shapes = (self.position.shape, self.orientation.shape)
        if shapes != ((3,), (4,)) or self.joint_pos.ndim != 1:
            raise ValueError(f"a posture needs position (3,), orientation (4,): {shapes}")
        values = np.concatenate([self.position, self.orientation, self.joint_pos])
        if not np.all(np.isfinite(values)):
            raise ValueError("a posture holds only finite numbers")
        norm = float(np.linalg.norm(self.orientation))
        if abs(norm - 1.0) > UNIT_TOLERANCE:
            raise ValueError(f"orientation has length {norm:.4f}, expected 1 (a unit quaternion)")

    @property
    def gravity_b(self) -> Array:
        """Return the direction of gravity in the root frame, shape (3,)."""
        return quaternion.gravity_in_body(self.orientation)
