"""The reward for following style curves ([Frezzato22], section 5.1)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robots.quaternion import Array

HEIGHT_WEIGHT = 2.5  # 1.7 per meter in the paper, whose human's neck is at 1.46 m
ANGLE_WEIGHT = 1.5  # 1/rad
SPEED_WEIGHT = 0.05  # s/rad
POSTURE_WEIGHT = 0.1  # 1/rad
PHASE_WEIGHT = 20.0
MOST_OFFSET = 0.2  # rad per joint on average, at which the naturalness is 0: 10 for 49 joints


@dataclass(frozen=True, kw_only=True, eq=False)
class StyleReward:
    """The factors of the reward of [Frezzato22], equations (3) to (9), for N robots."""

    height: Array
    angles: Array
    stillness: Array
    posture: Array
    natural: Array

    @property
    def task(self) -> Array:
        """Return the task reward, equation (4), (N,)."""
        return self.height * self.angles * self.stillness * self.posture

    @property
    def total(self) -> Array:
        """Return the reward, equation (2), (N,)."""
        return self.task * self.natural


def reward_style(
    features: Array, wanted: Array, speed: Array, from_stance: Array, offsets: Array
) -> StyleReward:
    """Compute the reward of [Frezzato22], section 5.1.

    Args:
        features: Measured style features, (N, 3).
        wanted: Those of the curves, (N, 3).
        speed: Of joints and torso [rad/s], (N, m).
        from_stance: Of each joint from standing [rad], (N, n).
        offsets: Of each joint's target from the decoded posture [rad], (N, n).
    """
    error = np.abs(features - wanted)
    phase = np.exp(-PHASE_WEIGHT * np.maximum(1.0 - wanted[:, 0], 0.0))

    def count_at_end(value: Array) -> Array:
        """Weight a factor by the progress along the curve, equations (7) and (9)."""
        return (1.0 - phase) + phase * value

    offset = np.abs(offsets).mean(axis=1) / MOST_OFFSET
    return StyleReward(
        height=np.exp(-HEIGHT_WEIGHT * error[:, 0]),
        angles=np.exp(-ANGLE_WEIGHT * error[:, 1:].sum(axis=1)),
        stillness=count_at_end(np.exp(-SPEED_WEIGHT * np.linalg.norm(speed, axis=1))),
        posture=count_at_end(np.exp(-POSTURE_WEIGHT * np.abs(from_stance).sum(axis=1))),
        natural=1.0 - np.clip(offset**2, 0.0, 1.0),
    )
