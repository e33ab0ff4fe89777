"""Lying down: judges whether a robot came to lie softly and still."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from humanoid_getup.experiments.judging.record import Record
from robots import quaternion
from robots.quaternion import Array

LyingSide = Literal["supine", "prone", "left", "right"]
LYING_TIME = 1.0  # s without motion at the end
MAX_LEAN = math.radians(30.0)
"""Greatest angle between gravity and the direction that it has in the torso on that side."""
MAX_SWAY = 0.03  # rad that a joint or the torso may move in that time; an encoder tick is 0.0015
MAX_DESCENT = 0.5  # m/s; a robot that falls over reaches 2 and more
MAX_HEAD_IMPACT = 0.3  # m/s
DESCENT_TIME = 0.04  # s over which the speed of descent is measured

GRAVITY_B: dict[LyingSide, tuple[float, float, float]] = {
    "supine": (-1.0, 0.0, 0.0),
    "prone": (1.0, 0.0, 0.0),
    "left": (0.0, 1.0, 0.0),
    "right": (0.0, -1.0, 0.0),
}
"""Direction of gravity in the torso of a robot that lies on a side."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Lying:
    """How records of lying down ended."""

    lean: Array
    """Greatest angle off the side at the end [rad], (...)."""
    sway: Array
    """Greatest motion of a joint or of the torso at the end [rad], (...)."""
    descent: Array
    """Fastest descent of the neck [m/s], (...): no part of the torso strikes much faster."""

    @property
    def lies(self) -> NDArray[np.bool_]:
        """Return whether the robot ended lying softly and still on the side, (...)."""
        return (self.lean <= MAX_LEAN) & (self.sway <= MAX_SWAY) & (self.descent <= MAX_DESCENT)


def judge_lying(
    orientation: Array, joint_pos: Array, neck_height: Array, period: float, side: LyingSide
) -> Lying:
    """Judge records of T samples that are a period [s] apart.

    They are the orientation of the torso, (..., T, 4), the joint angles [rad], (..., T, n), and
    the height of the neck [m], (..., T).
    """
    last, window = round(LYING_TIME / period), max(1, round(DESCENT_TIME / period))
    count = neck_height.shape[-1]
    if count <= max(last, window):  # too short to tell
        unknown = np.full(neck_height.shape[:-1], np.inf)
        return Lying(lean=unknown, sway=unknown, descent=unknown)
    gravity_b = quaternion.gravity_in_body(orientation[..., -last:, :])
    lean = np.arccos(np.clip(gravity_b @ np.array(GRAVITY_B[side]), -1.0, 1.0))
    moved = np.concatenate([gravity_b, joint_pos[..., -last:, :]], axis=-1)
    sunk = neck_height[..., :-window] - neck_height[..., window:]
    return Lying(
        lean=lean.max(axis=-1),
        sway=np.ptp(moved, axis=-2).max(axis=-1),
        descent=sunk.max(axis=-1) / (window * period),
    )


def measure_lying(record: Record, side: LyingSide) -> Lying:
    """Judge the ends of runs, (...)."""
    return judge_lying(
        record.orientation, record.joint_pos, record.neck[..., 2], record.period, side
    )
