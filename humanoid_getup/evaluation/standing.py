"""Standing: the one definition that every test and benchmark shares."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robots import Robot
from robots.quaternion import Array

HOLD_TIME = 3.0  # s
MAX_TILT = math.radians(15.0)
MIN_NECK_SHARE = 0.90


@dataclass(frozen=True, kw_only=True)
class Stand:
    """Whether and when a robot stood."""

    stood: bool
    """Whether the last moments of the record are a stand held for 3.0 s."""
    start_time: float
    """First moment of that held stand [s]; nan if it did not stand."""
    hold_time: float
    """How long the last unbroken stand of the record lasted [s]."""


def is_upright(
    neck_height: Array, tilt: Array, foreign: NDArray[np.bool_], robot: Robot
) -> NDArray[np.bool_]:
    """Tell, sample by sample, whether the robot is in the standing condition.

    Args:
        neck_height: Height of the neck over the ground under the feet [m], (..., T).
        tilt: Angle between the torso's z axis and the vertical [rad], (..., T).
        foreign: Whether anything but the feet touches the world, (..., T).
        robot: Gives the nominal standing neck height.
    """
    tall = neck_height >= MIN_NECK_SHARE * robot.standing_neck_height
    return tall & (tilt <= MAX_TILT) & ~foreign


def judge(upright: NDArray[np.bool_], period: float, hold_time: float = HOLD_TIME) -> Stand:
    """Judge one record (T,) of :func:`is_upright`, sampled at the end of every ``period``.

    The stand that counts is the one that lasts to the end of the record: a robot
    that stood and fell again did not rise. Only a search that checks what it finds may
    ask for a shorter ``hold_time`` [s].
    """
    broken = np.flatnonzero(~upright)
    first = 0 if len(broken) == 0 else int(broken[-1]) + 1
    hold = max(len(upright) - first - 1, 0) * period  # from the first sample to the last
    stood = hold >= hold_time - 1e-9
    return Stand(
        stood=stood, start_time=(first + 1) * period if stood else math.nan, hold_time=hold
    )


HOLD = HOLD_TIME + 1.5  # s after the motion; a robot may sway before its stand begins
