"""Followed styles: how near a rise came to its curves, and whether another style is nearer."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from msgspec import UNSET, UnsetType
from numpy.typing import NDArray

from humanoid_getup.style.curves import CurveTargets, StyleCurves
from humanoid_getup.style.features import COUNT, angle_distance
from humanoid_getup.style.style import Style
from robots.quaternion import Array

# Weights of errors in the reward of [Frezzato22], equations (5) and (6).
HEIGHT_WEIGHT = 2.5  # 1.7 per meter in the paper, whose human's neck is at 1.46 m
ANGLE_WEIGHT = 1.5  # 1/rad
MOST_DISTANCE = 1.0  # of a rise that followed its curves: both factors of the reward are e^-1
SAME = 0.3  # distance up to which curves ask for the same motion
FAR = math.radians(45.0)  # between how a robot lies and how its curves begin


def weigh(error: Array) -> Array:
    """Compute the distance of mean errors of the features, (..., 3), as (...).

    It is the mean of -log of the reward's factors for height and angles.
    """
    return error @ np.array([HEIGHT_WEIGHT, ANGLE_WEIGHT, ANGLE_WEIGHT])


class StyleErrors:
    """Deviations of N robots from their first curves, while these last.

    A robot that deviates restarts on other curves: the errors are still those from the first. One
    that stands from the first is at the end of its curves; its errors are those from a stand.
    """

    def __init__(self, curves: Sequence[StyleCurves], features: Array, time: Array) -> None:
        """Begin with features (N, 3) of robots at times on their curves [s], (N,)."""
        self._curves, self._features = curves, features
        self.duration = np.array([curve.duration for curve in curves])
        """Of the curves [s], (N,)."""
        self._begin = time.copy()
        self._passed: list[float] = []  # since the beginning [s]
        self._seen: list[Array] = []

    def note(self, features: Array, step_time: float) -> None:
        """Record the measured features, (N, 3), at the end of a policy step [s].

        Errors are computed afterwards, because a robot records within a control cycle.
        """
        self._passed.append(self.passed + step_time)
        self._seen.append(features)

    @property
    def passed(self) -> float:
        """Return the time since the beginning [s]."""
        return self._passed[-1] if self._passed else 0.0

    @property
    def stood_already(self) -> NDArray[np.bool_]:
        """Return whether each robot was at the end of its curves at the start, (N,)."""
        return self._begin >= self.duration

    @property
    def share(self) -> Array:
        """Return the share of the curves' durations that has passed, up to 1, (N,)."""
        return np.clip((self.passed + 1e-9) / self.duration, 0.0, 1.0)

    @property
    def mean(self) -> Array:
        """Return the mean errors, (N, 3); NaN where nothing was recorded."""
        return self._compare(self._curves)

    def find_nearest(self, styles: Sequence[Style]) -> NDArray[np.str_]:
        """Find the style to which each robot came nearer than to its first curves, (N,).

        Its curves are compared at equal shares of their durations. It is "" where there is none: a
        style that asks for the same motion is not another.
        """
        nearest = np.full(len(self._curves), "", dtype=object)
        least = weigh(self.mean)
        for style in styles:
            others = [style.choose(features) for features in self._features]
            values, given = ([each.values for each in some] for some in (others, self._curves))
            apart = weigh(np.abs(np.subtract(values, given)).mean(axis=1))
            distance = weigh(self._compare(others))
            is_nearer = (distance < least) & (apart > SAME) & ~self.stood_already
            nearest[is_nearer], least[is_nearer] = style.name, distance[is_nearer]
        return nearest.astype(str)

    def _compare(self, curves: Sequence[StyleCurves]) -> Array:
        """Compute the mean errors from curves that last as long as the first ones, (N, 3)."""
        n = len(curves)
        if not self._seen:
            return np.full((n, COUNT), np.nan)
        targets, passed = CurveTargets(n), np.array(self._passed)  # (T,)
        pieces = np.array([curve.pieces for curve in curves])
        targets.enter(np.arange(n), pieces, self.duration, self._features, self._begin)
        wanted = targets.at(self._begin[:, np.newaxis] + passed)  # (N, T, 3)
        off = np.abs(np.stack(self._seen, axis=1) - wanted)
        lasts = (passed <= self.duration[:, np.newaxis] + 1e-9)[..., np.newaxis]
        steps = lasts.sum(axis=1)
        return np.sum(off * lasts, axis=1) / np.where(steps > 0, steps, np.nan)


@dataclass(frozen=True, kw_only=True)
class StyleFigures:
    """Figures of a followed style, under report.json's keys; unset without a style."""

    style_followed: bool | UnsetType = UNSET
    style_nearest: str | UnsetType = UNSET
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
    nearest: str = ""
    """Named style to which it came nearer; "" for none."""

    @staticmethod
    def of(
        errors: StyleErrors, curves: StyleCurves, features: Array, restarts: int, nearest: str = ""
    ) -> FollowedStyle:
        """Collect the figures of one robot, which began with features (3,)."""
        mean = errors.mean[0]
        return FollowedStyle(
            height_error=float(mean[0]),
            angle_error=float(mean[1:].mean()),
            share=float(errors.share[0]),
            restarts=restarts,
            start_error=float(angle_distance(curves.values[0], features)),
            stood_already=bool(errors.stood_already[0]),
            nearest=nearest,
        )

    @property
    def was_followed(self) -> bool:
        """Return whether the curves were followed to their end, nearest, without a restart."""
        error = np.array([self.height_error, self.angle_error, self.angle_error])
        is_near = weigh(error) <= MOST_DISTANCE and not self.nearest
        return bool(is_near) and self.restarts == 0 and self.share == 1.0

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
        if self.nearest:
            text += f"; nearer to {self.nearest}"
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
            style_nearest=self.nearest or "given",
            style_height_error=self.height_error,
            style_angle_error_deg=math.degrees(self.angle_error),
            style_restarts=self.restarts,
            style_start_error_deg=math.degrees(self.start_error),
            style_summary=str(self),
        )
