"""Style editor: a style that is changed step by step, and can be undone."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import scipy  # which imports its parts when they are used

from humanoid_getup.style.curves import HIGHEST_VALUES, PLACES, POINTS, StyleCurves
from humanoid_getup.style.features import COUNT
from humanoid_getup.style.style import Style, round_curves, write_style
from robots import Robot
from robots.quaternion import Array

SAMPLES = 801
EDGE = 0.02  # share of the duration that an edited rise keeps from the ends


def rise_time(curves: StyleCurves) -> float:
    """Return when the neck last passes the middle between its lowest height and its end [s]."""
    time = np.linspace(0.0, curves.duration, SAMPLES)
    return find_rise(time, curves.sample(time)[:, 0])


def find_rise(time: Array, height: Array) -> float:
    """Find when a neck height (T,) last passes the middle between its least and last value [s]."""
    middle = 0.5 * (height.min() + height[-1])
    below = np.flatnonzero(height < middle)
    k = int(below[-1]) if len(below) else 0
    following = min(k + 1, len(time) - 1)
    span = height[following] - height[k]
    share = (middle - height[k]) / span if span > 0.0 else 0.0
    return float(time[k] + share * (time[following] - time[k]))


def shift_rise(curves: StyleCurves, delay: float) -> StyleCurves:
    """Move the time of the rise by a delay [s], below 0 for sooner; the duration stays."""
    now, wanted = rise_time(curves), rise_time(curves) + delay

    def warp(share: float) -> StyleCurves:
        """Move the features at the time of the rise to a share of the duration."""
        bend = scipy.interpolate.PchipInterpolator(
            [0.0, share, 1.0], [0.0, now / curves.duration, 1.0]
        )
        return curves.retimed(curves.duration * bend(PLACES), curves.duration)

    def miss(share: float) -> float:
        return rise_time(warp(share)) - wanted

    early, late = miss(EDGE), miss(1.0 - EDGE)
    if not early < 0.0 < late:
        raise ValueError(
            f"the rise would be at {wanted:.4g} s of {curves.duration:.2f} s, expected "
            f"{wanted + early:.2f} to {wanted + late:.2f} s: make the style slower first"
        )
    found: Any = scipy.optimize.brentq(miss, EDGE, 1.0 - EDGE, xtol=1e-4)
    return warp(float(found))


def hold(curves: StyleCurves, at: float, time: float) -> StyleCurves:
    """Hold the features of a time [s] for a duration [s]; the curves become longer by it.

    Nine control points round the corners of a hold that is short against the duration.
    """
    if not 0.0 <= at <= curves.duration:
        raise ValueError(f"hold is at {at:.4g} s, expected 0 to {curves.duration:.2f} s")
    duration = curves.duration + time
    then = PLACES * duration
    before = np.where(then <= at, then, np.maximum(at, then - time))
    return curves.retimed(before, duration)


MOST_STEPS = 200


class StyleEditor:
    """A style, which of its curves are edited, and the steps back.

    Its curves have the digits of a style file, so that a file of it holds the same ones.
    """

    def __init__(self, robot: Robot, style: Style) -> None:
        self._robot = robot
        self._style = _round(style)
        self._before: list[Style] = []
        self._is_timed = False  # whether the last change was of the duration
        self.chosen = 0
        """Number of the curves that are edited, from 0."""

    @property
    def style(self) -> Style:
        """Return the style as it is now."""
        return self._style

    @property
    def curves(self) -> StyleCurves:
        """Return the chosen curves as they are now."""
        return self._style.curves[self.chosen]

    def move_point(self, feature: int, point: int, value: float) -> StyleCurves:
        """Return the chosen curves with another value of one control point; nothing is changed.

        Features and points are numbered from 0; values are shares of standing, or [rad].
        """
        if not (0 <= feature < COUNT and 0 <= point < POINTS):
            raise ValueError(f"there is no point {point + 1} of curve {feature + 1}")
        points = self.curves.points
        points[point, feature] = value
        return round_curves(StyleCurves.of(points, self.curves.duration, self.curves.start))

    def preview(self, curves: StyleCurves) -> Style:
        """Return the style with other curves in place of the chosen ones; nothing is changed."""
        every = list(self._style.curves)
        every[self.chosen] = round_curves(curves)
        return replace(self._style, curves=tuple(every), followed_from=None)

    def change(self, curves: StyleCurves) -> None:
        """Replace the chosen curves."""
        self._before = [*self._before, self._style][-MOST_STEPS:]
        self._style, self._is_timed = self.preview(curves), False

    def last(self, duration: float) -> None:
        """Let the chosen curves last for a duration [s]; several in a row are one step."""
        style = self.preview(self.curves.lasting(duration))
        if self._is_timed:
            self._style = style
        else:
            self.change(style.curves[self.chosen])
        self._is_timed = True

    def shift(self, delay: float) -> None:
        """Move the time of the rise by a delay [s], below 0 for sooner."""
        self.change(shift_rise(self.curves, delay))

    def hold(self, at: float, time: float) -> None:
        """Hold the features of a time [s] for a duration [s]."""
        self.change(hold(self.curves, at, time))

    def mirror(self) -> None:
        """Exchange left and right of the chosen curves."""
        self.change(self.curves.mirrored())

    def undo(self) -> None:
        """Take back the last change."""
        if not self._before:
            raise ValueError("there is no change to undo")
        self._style, self._is_timed = self._before.pop(), False

    def save(self, file: Path) -> None:
        """Write a style file; the style has its name from then on."""
        write_style(self._style, self._robot, file)
        self._style = replace(self._style, name=file.stem)


def clip_value(feature: int, value: float) -> float:
    """Clip the value of a feature to what any control point may have."""
    return min(max(value, 0.0), float(HIGHEST_VALUES[feature]))


def _round(style: Style) -> Style:
    return replace(style, curves=tuple(map(round_curves, style.curves)))
