"""Ankle balance: near the stance, ankles turn the torso back to the angles of the curves."""

from __future__ import annotations

import numpy as np

from humanoid_getup.playback.balance import find_ankles
from humanoid_getup.simulation.world import World
from robots import Robot
from robots.quaternion import Array

# Correction of the ankles per error of the side and of the front angle. Larger ones stand on
# steeper ground, and oscillate where targets are delayed by 0.06 s.
GAINS = np.array([0.3, 0.8])
LARGEST = 0.35  # rad
BEGIN, FULL = 0.80, 0.95  # neck heights from which it acts, and acts as a whole


class AnkleBalance:
    """Corrects the joint targets of robots that have nearly risen.

    An addition to [Frezzato22], whose policy moves ankles by itself: on ground that slopes under
    the feet, a robot that follows its curves with the ankles of level ground topples at their end.
    """

    def __init__(self, robot: Robot) -> None:
        self.ankles = find_ankles(World(robot, "flat"))
        """Changes of the joint angles per rotation of the torso to the side and front, (2, n)."""

    def correct(self, wanted: Array, measured: Array) -> Array:
        """Compute corrections of joint targets [rad], (N, n), from style features (N, 3)."""
        share = np.clip((measured[:, :1] - BEGIN) / (FULL - BEGIN), 0.0, 1.0)
        turn_back = np.clip(GAINS * (wanted - measured)[:, 1:], -LARGEST, LARGEST)
        return share * turn_back @ self.ankles
