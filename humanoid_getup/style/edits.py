"""Edits of style curves: rise sooner or later, slower or faster, with a hold."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.optimize import brentq

from humanoid_getup.style.curves import PLACES, StyleCurves
from robots.quaternion import Array

SAMPLES = 801
EDGE = 0.02  # share of the duration that an edited rise keeps from the ends


class EditError(ValueError):
    """An edit is impossible; the message names what is possible."""


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
    """Move the time of the rise by a delay [s], below 0 for sooner; the duration stays.

    Raises:
        EditError: if the rise would be too near to the beginning or the end.
    """
    now, wanted = rise_time(curves), rise_time(curves) + delay

    def warp(share: float) -> StyleCurves:
        """Move the features at the time of the rise to a share of the duration."""
        bend = PchipInterpolator([0.0, share, 1.0], [0.0, now / curves.duration, 1.0])
        return curves.retimed(curves.duration * bend(PLACES), curves.duration)

    def miss(share: float) -> float:
        return rise_time(warp(share)) - wanted

    early, late = miss(EDGE), miss(1.0 - EDGE)
    if not early < 0.0 < late:
        raise EditError(
            f"the rise would be at {wanted:.4g} s of {curves.duration:.2f} s, expected "
            f"{wanted + early:.2f} to {wanted + late:.2f} s: make the style slower first"
        )
    found: Any = brentq(miss, EDGE, 1.0 - EDGE, xtol=1e-4)
    return warp(float(found))


def hold(curves: StyleCurves, at: float, time: float) -> StyleCurves:
    """Hold the features of a time [s] for a duration [s]; the curves become longer by it.

    Nine control points round the corners of a hold that is short against the duration.

    Raises:
        EditError: if the moment is outside the duration.
    """
    if not 0.0 <= at <= curves.duration:
        raise EditError(f"hold is at {at:.4g} s, expected 0 to {curves.duration:.2f} s")
    duration = curves.duration + time
    then = PLACES * duration
    before = np.where(then <= at, then, np.maximum(at, then - time))
    return curves.retimed(before, duration)
