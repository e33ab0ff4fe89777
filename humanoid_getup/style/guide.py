"""Guides robots along style curves: what they measure, what is wanted now and shortly after.

Training, evaluation and robot call the same code, on a thousand robots or on one.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from humanoid_getup.style.curves import LOOKAHEAD, CurveTargets, StyleCurves
from humanoid_getup.style.features import COUNT, FeatureSense
from robots import Robot
from robots.quaternion import Array

STATE = ("time", "features", "targets")


class StyleGuide:
    """Curves that N robots follow, and the features that they measure."""

    def __init__(self, robot: Robot, n: int = 1, threads: int = 1) -> None:
        """Prepare to guide ``n`` robots; 0 threads are one per processor."""
        self._curves = CurveTargets(n)
        self._sense = FeatureSense(robot, n, threads)
        self.time = np.zeros(n)
        """Of each robot on its curves [s], (N,)."""
        self.features = np.zeros((n, COUNT))
        """Features that the robots measure, (N, 3)."""
        self.targets = np.zeros((n, len(LOOKAHEAD), COUNT))
        """Wanted features now and ahead, (N, 4, 3)."""

    @property
    def wanted(self) -> Array:
        """Return the features that are wanted now, (N, 3)."""
        return self.targets[:, 0]

    @property
    def duration(self) -> Array:
        """Return how long the curves last [s], (N,)."""
        return self._curves.duration

    def measure(self, gravity: Array, joint_pos: Array) -> None:
        """Estimate the features from gravity in the torso (N, 3) and joint angles (N, n) [rad]."""
        self.features = self._sense(gravity, joint_pos)

    def enter(self, ids: NDArray[np.int_], pieces: Array, duration: Array, time: Array) -> None:
        """Let some robots follow curves from times on, blended from what they measure.

        Args:
            ids: Which robots, (m,).
            pieces: Their curves, (m, 8, 4, 3).
            duration: Of the curves [s], (m,).
            time: When on the curve they are [s], (m,).
        """
        self._curves.enter(ids, pieces, duration, self.features[ids], time)
        self.time[ids] = time
        self._look()

    def enter_all(self, curves: list[StyleCurves]) -> None:
        """Let all robots follow curves from their beginning, one each."""
        pieces = np.array([curve.pieces for curve in curves])
        duration = np.array([curve.duration for curve in curves])
        self.enter(np.arange(len(curves)), pieces, duration, np.zeros(len(curves)))

    def advance(self, step_time: float) -> None:
        """Go along the curves for a policy step [s]."""
        self.time = self.time + step_time
        self._look()

    def _look(self) -> None:
        self.targets = self._curves.at(self.time[:, np.newaxis] + LOOKAHEAD)

    def save_state(self) -> dict[str, Any]:
        """Return the complete state, for :meth:`restore_state`."""
        arrays = {name: getattr(self, name).copy() for name in STATE}
        return {"curves": self._curves.save_state(), **arrays}

    def restore_state(self, state: dict[str, Any]) -> None:
        """Restore a state of :meth:`save_state`."""
        self._curves.restore_state(state["curves"])
        for name in STATE:
            setattr(self, name, state[name].copy())
