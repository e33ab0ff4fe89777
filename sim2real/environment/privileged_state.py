"""Privileged state: what only a simulation knows of robots in training."""

from __future__ import annotations

from dataclasses import dataclass

from humanoid_getup.evaluation.standing import Stance
from robots.quaternion import Array


@dataclass(frozen=True, kw_only=True, eq=False)
class PrivilegedState:
    """What only a simulation knows of N robots: for rewards and critics."""

    stance: Stance
    """(N,)"""
    sole_height: Array
    """Of each sole over the ground [m], (N, soles)."""
    sole_distance: Array
    """Horizontal distance of the soles' middle from the neck [m], (N,)."""
    upright: Array
    """Cosine of the torso's tilt, (N,)."""
    head_fall: Array
    """Downward speed of the head [m/s]; 0 without a head, (N,)."""
    root_vel: Array
    """Linear (world) and angular (torso) velocity of the torso [m/s, rad/s], (N, 6)."""
    joint_vel: Array
    """[rad/s], (N, n)"""
    torque: Array
    """Of the servos [N·m], (N, n)."""
