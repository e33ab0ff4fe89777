"""Follows a style with one robot: its first curves, restarts, and errors."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from humanoid_getup.policy.observation import Sensed, observe_style
from humanoid_getup.style.curve_tracker import CurveTracker
from humanoid_getup.style.curves import StyleCurves
from humanoid_getup.style.style import Style
from humanoid_getup.style.style_errors import FollowedStyle, StyleErrors
from robots import Robot
from robots.quaternion import Array

LYING = 0.6  # share of the standing neck height below which a robot lies, sits or kneels
LOST = 3.0  # s of deviation from style curves while it lies where none begin: it has failed then


@dataclass(frozen=True, eq=False)
class _First:
    """The first curves of a rise, and the errors from them."""

    curves: StyleCurves
    features: Array
    """Measured then, (3,)."""
    errors: StyleErrors


class StyleFollower:
    """Follows a style from one policy step to the next."""

    def __init__(self, robot: Robot, style: Style) -> None:
        self._style, self._tracker = style, CurveTracker(robot)
        self.reset()

    def reset(self) -> None:
        """Begin a rise: the first measurement decides which curves are followed."""
        self._first: _First | None = None
        self._restarts = 0
        self.is_lost = False
        """Whether it has deviated for long, and lies where no curves begin."""

    def update(self, sensed: Sensed, step_time: float) -> bool:
        """Advance by a policy step [s]; return whether the robot restarts on other curves."""
        tracker, one = self._tracker, np.arange(1)
        tracker.measure(sensed.gravity[None], sensed.joint_pos[None])
        if self._first is None:
            curves = self._style.choose(self.measured)
            tracker.begin(one, [curves])
            errors = StyleErrors([curves], tracker.features, tracker.time)
            self._first = _First(curves, self.measured, errors)
            return False
        self._first.errors.note(tracker.features, step_time)
        tracker.advance(step_time)
        again = tracker.restart_deviating(step_time, lambda _, seen: self._style.choose(seen))
        self._restarts += len(again)
        self.is_lost = bool(self.measured[0] < LYING and tracker.deviating[0] > LOST)
        return len(again) > 0

    def observe(self) -> list[Array]:
        """Return the terms of style in a policy's observation."""
        return [term[0] for term in observe_style(self._tracker.targets, self._tracker.features)]

    @property
    def wanted(self) -> Array:
        """Return the features that are wanted now, (3,)."""
        return self._tracker.wanted[0]

    @property
    def measured(self) -> Array:
        """Return the features that were measured last, (3,)."""
        return self._tracker.features[0]

    def summarize(self) -> FollowedStyle | None:
        """Summarize how the first curves were followed so far; ``None`` before the first step."""
        first = self._first
        if first is None:
            return None
        return FollowedStyle.of(first.errors, first.curves, first.features, self._restarts)
