"""What the torque of a servo does: drives its joint, or is driven against it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robots.quaternion import Array


@dataclass(frozen=True, eq=False)
class TorqueShares:
    """Torques of servos apart, by what they do; magnitudes [N·m], (..., n)."""

    driving: Array
    """Torque along the joint's motion, or at rest; else 0. A limit holds for it."""
    braking: Array
    """Torque against a motion that comes from outside; else 0.

    By PWM it exceeds the limit: back-EMF adds to the voltage that is limited.
    """


def split_torque(torque: Array, velocity: Array) -> TorqueShares:
    """Tell driving from braking, by torques [N·m] and joint speeds [rad/s], (..., n)."""
    size, drives = np.abs(torque), torque * velocity >= 0.0
    return TorqueShares(driving=np.where(drives, size, 0.0), braking=np.where(drives, 0.0, size))
