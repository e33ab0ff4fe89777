"""A strategy that plays one stored motion."""

from __future__ import annotations

import numpy as np

from humanoid_getup.motions.motion import Motion
from humanoid_getup.strategies.plan import MotionPlan, RiseStatus
from robots import Posture


class StoredMotion:
    """Plays one motion as it is, for every start; the preflight may refuse it."""

    def __init__(self, motion: Motion) -> None:
        self._motion = motion

    def plan(self, _start: Posture, _rng: np.random.Generator) -> MotionPlan:
        """Plan to play the motion."""
        status = RiseStatus.STORED
        return MotionPlan(status=status, reason=status.value, motion=self._motion)
