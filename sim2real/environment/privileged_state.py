"""What only a simulation knows of a herd's robots."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robots.quaternion import Array


@dataclass(frozen=True, kw_only=True, eq=False)
class PrivilegedState:
    """What only a simulation knows of N robots: for rewards, critics and judges."""

    neck_height: Array
    """Over the ground [m], (N,)."""
    sole_height: Array
    """Of each sole over the ground [m], (N, soles)."""
    sole_distance: Array
    """Horizontal distance of the soles' middle from the neck [m], (N,)."""
    upright: Array
    """Cosine of the torso's tilt, (N,)."""
    foreign: NDArray[np.bool_]
    """Whether anything but the feet touches the world, (N,)."""
    head_fall: Array
    """Downward speed of the head [m/s]; 0 for who has none, (N,)."""
    root_vel: Array
    """Linear (world) and angular (torso) velocity of the torso [m/s, rad/s], (N, 6)."""
    joint_vel: Array
    """[rad/s], (N, n)"""
    torque: Array
    """Of the servos [N·m], (N, n)."""
