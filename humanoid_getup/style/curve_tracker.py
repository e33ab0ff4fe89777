"""Tracks robots along style curves: measured features, targets ahead, and mean errors.

Training, evaluation and robot call the same code, on a thousand robots or on one.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from msgspec import UNSET, UnsetType
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
            if angle_distance(curves.points[0], self.features[row]) <= MOST_ANGLE_ERROR
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


# Mean errors up to which curves count as followed: planned rises are followed within half of them.
FOLLOWED_HEIGHT = 0.1  # share of the standing neck height
FOLLOWED_ANGLE = math.radians(20.0)
FAR = math.radians(45.0)  # between how a robot lies and how its curves begin


class StyleErrors:
    """Deviations of N robots from their first curves, while these last.

    A robot that deviates restarts on other curves: the errors are still those from the first. One
    that stands from the first is at the end of its curves; its errors are those from a stand.
    """

    def __init__(self, curves: Sequence[StyleCurves], features: Array, time: Array) -> None:
        """Begin with features (N, 3) of robots at times on their curves [s], (N,)."""
        n = len(curves)
        self._asked = CurveTargets(n)
        pieces = np.array([curve.pieces for curve in curves])
        self.duration = np.array([curve.duration for curve in curves])
        """Of the curves [s], (N,)."""
        self._asked.enter(np.arange(n), pieces, self.duration, features, time)
        self._begin = time.copy()
        self._passed: list[float] = []  # since the beginning [s]
        self._seen: list[Array] = []

    def note(self, features: Array, step_time: float) -> None:
        """Record the measured features, (N, 3), at the end of a policy step [s].

        Errors are computed afterwards, because a robot records within a control cycle.
        """
        self._passed.append(step_time + (self._passed[-1] if self._passed else 0.0))
        self._seen.append(features)

    @property
    def stood_already(self) -> NDArray[np.bool_]:
        """Return whether each robot was at the end of its curves at the start, (N,)."""
        return self._begin >= self.duration

    @property
    def share(self) -> Array:
        """Return the share of the curves' durations that has passed, up to 1, (N,)."""
        passed = self._passed[-1] if self._passed else 0.0
        return np.clip((passed + 1e-9) / self.duration, 0.0, 1.0)

    @property
    def mean(self) -> Array:
        """Return the mean errors, (N, 3); NaN where nothing was recorded."""
        if not self._seen:
            return np.full((len(self.duration), COUNT), np.nan)
        passed = np.array(self._passed)  # (T,)
        wanted = self._asked.at(self._begin[:, np.newaxis] + passed)  # (N, T, 3)
        off = np.abs(np.stack(self._seen, axis=1) - wanted)
        lasts = (passed <= self.duration[:, np.newaxis] + 1e-9)[..., np.newaxis]
        steps = lasts.sum(axis=1)
        return np.sum(off * lasts, axis=1) / np.where(steps > 0, steps, np.nan)


@dataclass(frozen=True, kw_only=True)
class StyleFigures:
    """Figures of a followed style, under report.json's keys; unset without a style."""

    style_followed: bool | UnsetType = UNSET
    style_height_error: float | UnsetType = UNSET
    style_angle_error_deg: float | UnsetType = UNSET
    style_restarts: int | UnsetType = UNSET
    style_start_error_deg: float | UnsetType = UNSET
    style_summary: str | UnsetType = UNSET


@dataclass(frozen=True, kw_only=True)
class FollowedStyle:
    """Figures of one robot on its first curves."""

    height_error: float
    """Mean error of the neck height while they lasted, as a share of standing; NaN for none."""
    angle_error: float
    """Mean error of both torso angles while they lasted [rad]; NaN for none."""
    share: float
    """Share of the duration that had passed when the rise ended."""
    restarts: int
    """How often the robot deviated, and restarted on other curves."""
    start_error: float
    """Angle between the robot's start and the beginning of the curves [rad]."""
    stood_already: bool = False
    """Whether the robot stood at the start, so that there was nothing to follow."""

    @staticmethod
    def of(
        errors: StyleErrors, curves: StyleCurves, features: Array, restarts: int
    ) -> FollowedStyle:
        """Collect the figures of one robot, which began with features (3,)."""
        mean = errors.mean[0]
        return FollowedStyle(
            height_error=float(mean[0]),
            angle_error=float(mean[1:].mean()),
            share=float(errors.share[0]),
            restarts=restarts,
            start_error=float(angle_distance(curves.points[0], features)),
            stood_already=bool(errors.stood_already[0]),
        )

    @property
    def was_followed(self) -> bool:
        """Return whether the curves were followed to their end, without a restart."""
        is_near = self.height_error <= FOLLOWED_HEIGHT and self.angle_error <= FOLLOWED_ANGLE
        return is_near and self.restarts == 0 and self.share == 1.0

    def __str__(self) -> str:
        """Summarize the figures in one line."""
        if self.stood_already:
            return "the robot stood already"
        text = "followed" if self.was_followed else "not followed"
        if self.share < 1.0:
            text += f", ended after {self.share:.0%} of its curves"
        if not math.isnan(self.height_error):
            text += f", mean errors {self.height_error:.2f} of the height and "
            text += f"{math.degrees(self.angle_error):.0f}°"
        if self.restarts:
            times = "once" if self.restarts == 1 else f"{self.restarts} times"
            text += f"; restarted {times} on curves nearer to how it lay then"
        if self.start_error > FAR:
            text += f"; the curves begin {math.degrees(self.start_error):.0f}° from how it lay"
        return text

    def figures(self) -> StyleFigures:
        """Return the figures under report.json's keys."""
        return StyleFigures(
            style_followed=self.was_followed,
            style_height_error=self.height_error,
            style_angle_error_deg=math.degrees(self.angle_error),
            style_restarts=self.restarts,
            style_start_error_deg=math.degrees(self.start_error),
            style_summary=str(self),
        )
