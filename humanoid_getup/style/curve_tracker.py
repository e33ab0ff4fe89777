"""Tracks robots along style curves: measured features, targets ahead, and restarts.

Training, evaluation and robot call the same code, on a thousand robots or on one.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from humanoid_getup.style.curves import (
    LOOKAHEAD,
    CurveTargets,
    SavedArrays,
    SavedState,
    StyleCurves,
    is_stand,
)
from humanoid_getup.style.features import COUNT, FeatureSense, angle_distance
from robots import Robot
from robots.quaternion import Array

MOST_ANGLE_ERROR = np.radians(45.0)  # of a torso angle, beyond which a robot deviates
MOST_HEIGHT_ERROR = 0.35  # of the neck height, likewise, as a share of standing
MOST_DEVIATION_TIME = 0.5  # s, after which a robot restarts


class CurveTracker(SavedArrays):
    """Curves that N robots follow, and the features that they measure."""

    saved = ("time", "features", "targets", "_deviating")

    def __init__(self, robot: Robot, n: int = 1, threads: int = 1) -> None:
        """Prepare to track ``n`` robots; 0 threads are one per processor."""
        self._curves = CurveTargets(n)
        self._sense = FeatureSense(robot, n, threads)
        self.time = np.zeros(n)
        """Time of each robot on its curves [s], (N,)."""
        self.features = np.zeros((n, COUNT))
        """Features that the robots measure, (N, 3)."""
        self.targets = np.zeros((n, len(LOOKAHEAD), COUNT))
        """Wanted features now and ahead, (N, 4, 3)."""
        self._deviating = np.zeros(n)  # [s] for which each robot has deviated

    @property
    def wanted(self) -> Array:
        """Return the wanted features, (N, 3)."""
        return self.targets[:, 0]

    @property
    def deviating(self) -> Array:
        """Return how long each robot has deviated without a restart [s], (N,)."""
        return self._deviating

    @property
    def duration(self) -> Array:
        """Return how long the curves last [s], (N,)."""
        return self._curves.duration

    def measure(self, gravity: Array, joint_pos: Array) -> None:
        """Estimate the features from gravity in the torso (N, 3) and joint angles (N, n) [rad]."""
        self.features = self._sense(gravity, joint_pos)

    def enter(self, ids: NDArray[np.int_], pieces: Array, duration: Array, time: Array) -> None:
        """Start some robots at times on curves, blended from their measured features.

        Those of ``ids``, (m,), are on curves (m, 8, 4, 3) of durations [s], at times [s], (m,).
        """
        self._curves.enter(ids, pieces, duration, self.features[ids], time)
        self.time[ids], self._deviating[ids] = time, 0.0
        self._update_targets()

    def begin(self, ids: NDArray[np.int_], curves: Sequence[StyleCurves]) -> None:
        """Start some robots at the beginning of curves, one each.

        A robot that stands is at their end already.
        """
        pieces = np.array([curve.pieces for curve in curves])
        duration = np.array([curve.duration for curve in curves])
        stands = is_stand(self.features[ids])
        self.enter(ids, pieces, duration, np.where(stands, duration, 0.0))

    def restart_deviating(
        self, step_time: float, choose: Callable[[int, Array], StyleCurves]
    ) -> NDArray[np.int_]:
        """Restart robots that deviate too long from their curves; return their rows, (m,).

        To be called once in each policy step [s]. The new curves are those that ``choose`` returns
        for the number of a robot and its measured features (3,); they are not followed if they
        begin farther from these than `MOST_ANGLE_ERROR`.
        """
        off = np.abs(self.features - self.wanted)
        is_off = (off[:, 0] > MOST_HEIGHT_ERROR) | (off[:, 1:].max(axis=1) > MOST_ANGLE_ERROR)
        self._deviating = np.where(is_off, self._deviating + step_time, 0.0)
        chosen = {
            row: choose(row, self.features[row])
            for row in np.flatnonzero(self._deviating > MOST_DEVIATION_TIME).tolist()
        }
        near = {
            row: curves
            for row, curves in chosen.items()
            if angle_distance(curves.values[0], self.features[row]) <= MOST_ANGLE_ERROR
        }
        ids = np.array(list(near), dtype=int)
        if near:
            self.begin(ids, list(near.values()))
        return ids

    def advance(self, step_time: float) -> None:
        """Advance along the curves by a policy step [s]."""
        self.time = self.time + step_time
        self._update_targets()

    def _update_targets(self) -> None:
        self.targets = self._curves.at(self.time[:, np.newaxis] + LOOKAHEAD)

    def save_state(self) -> SavedState:
        """Return the complete state, for :meth:`restore_state`."""
        return {"curves": self._curves.save_state(), **super().save_state()}

    def restore_state(self, state: SavedState) -> None:
        """Restore a state of :meth:`save_state`."""
        self._curves.restore_state(state["curves"])
        super().restore_state(state)
