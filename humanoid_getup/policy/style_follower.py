"""Style following for one robot or many: first curves, restarts, and errors."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from humanoid_getup.policy.observation import Sensed, observe_style
from humanoid_getup.style.curve_tracker import CurveTracker
from humanoid_getup.style.curves import StyleCurves
from humanoid_getup.style.features import COUNT
from humanoid_getup.style.followed_style import FollowedStyle, StyleErrors
from humanoid_getup.style.style import load_named
from robots import Robot
from robots.quaternion import Array

StyleChoice = Callable[[int, Array], StyleCurves]
"""Chooses curves by the number of a robot and its measured features (3,)."""

LYING = 0.6  # share of the standing neck height below which a robot lies, sits or kneels
LOST = 3.0  # s of deviation from style curves while it lies where none begin: it has failed then


class StyleFollower:
    """Follows a style from one policy step to the next."""

    def __init__(self, robot: Robot, choose: StyleChoice, n: int = 1) -> None:
        self._robot, self._n = robot, n
        self._choose, self._tracker = choose, CurveTracker(robot, n)
        self.reset()

    def reset(self) -> None:
        """Begin a rise: the first measurement determines the curves."""
        self._first: Sequence[StyleCurves] = ()  # curves
        self._start = np.zeros((self._n, COUNT))  # features
        self._errors: StyleErrors | None = None  # deviations from the first curves
        self.restarts = np.zeros(self._n, dtype=int)
        """How often each robot restarted after it had deviated from its curves, (N,)."""
        self.followed_for = np.full(self._n, np.inf)
        """Time of each robot's first restart since the beginning [s], inf without, (N,)."""

    def update(
        self, sensed: Sensed, step_time: float, true_features: Array | None = None
    ) -> NDArray[np.int_]:
        """Advance by a policy step [s]; return which robots restart on other curves, (m,).

        Errors are those of the true features (N, 3), where these are known.
        """
        tracker = self._tracker
        tracker.measure(np.atleast_2d(sensed.gravity), np.atleast_2d(sensed.joint_pos))
        if self._errors is None:
            self._start = self.measured
            self._first = [self._choose(row, seen) for row, seen in enumerate(self._start)]
            tracker.begin(np.arange(self._n), self._first)
            self._errors = StyleErrors(self._first, self._start, tracker.time)
            return np.arange(0)
        seen = self.measured if true_features is None else true_features
        self._errors.note(seen, step_time)
        tracker.advance(step_time)
        again = tracker.restart_deviating(step_time, self._choose)
        self.restarts[again] += 1
        self.followed_for[again] = np.minimum(self.followed_for[again], self._errors.passed)
        return again

    def observe(self) -> list[Array]:
        """Return the terms of style in the observations of policies, (N, k) each."""
        return list(observe_style(self._tracker.targets, self.measured))

    @property
    def wanted(self) -> Array:
        """Return the wanted features, (N, 3)."""
        return self._tracker.wanted

    @property
    def measured(self) -> Array:
        """Return the last measured features, (N, 3)."""
        return self._tracker.features

    @property
    def is_lost(self) -> NDArray[np.bool_]:
        """Return whether each robot has deviated for long and lies where no curves begin, (N,)."""
        if self._errors is None:
            return np.zeros(self._n, dtype=bool)
        return (self.measured[:, 0] < LYING) & (self._tracker.deviating > LOST)

    @property
    def mean_error(self) -> Array:
        """Return the mean errors from the first curves, (N, 3); NaN before the first step."""
        return self._errors.mean if self._errors else np.full((self._n, COUNT), np.nan)

    @property
    def duration(self) -> Array:
        """Return the durations of the first curves [s], (N,)."""
        return np.array([curves.duration for curves in self._first])

    def find_nearest(self) -> NDArray[np.str_]:
        """Find the named style to which each robot came nearer than to its first curves, (N,)."""
        if self._errors is None:
            return np.full(self._n, "")
        return self._errors.find_nearest(load_named(self._robot))

    def summarize(self) -> FollowedStyle | None:
        """Summarize how the first robot followed its curves; None before the first step."""
        if self._errors is None:
            return None
        restarts = int(self.restarts[0])
        nearest = str(self.find_nearest()[0])
        return FollowedStyle.of(self._errors, self._first[0], self._start[0], restarts, nearest)
