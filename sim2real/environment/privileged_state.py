"""Privileged state: quantities that only a simulation can measure."""

from __future__ import annotations

from dataclasses import dataclass

from humanoid_getup.evaluation.standing import Stance
from robots.quaternion import Array


@dataclass(frozen=True, kw_only=True, eq=False)
class PrivilegedState:
    """Quantities of N robots that only a simulation can measure, for rewards and critics."""

    stance: Stance
    """(N,)"""
    sole_height: Array
    """Height of each sole over the ground [m], (N, soles)."""
    sole_distance: Array
    """Horizontal distance of the soles' center from the neck [m], (N,)."""
    upright: Array
    """Cosine of the torso's tilt, (N,)."""
    head_fall: Array
    """Downward speed of the head [m/s]; 0 without a head, (N,)."""
    root_vel: Array
    """Linear (world) and angular (torso) velocity of the torso [m/s, rad/s], (N, 6)."""
    joint_vel: Array
    """[rad/s], (N, n)"""
    torque: Array
    """Servo torques [N·m], (N, n)."""
