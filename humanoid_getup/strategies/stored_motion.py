"""Stored motions instead of plans, for robots that cannot wait for one."""

from __future__ import annotations

import numpy as np

from humanoid_getup.motions.motion import Motion
from humanoid_getup.motions.motion_database import MotionDatabase
from humanoid_getup.strategies.plan import RisePlan, RiseStatus
from robots import Posture


class NearestMotion:
    """Chooses a stored motion instead of planning: the one that begins most like the robot lies.

    The player leads the joints to where the motion
    begins; the preflight says whether it gets up from there.
    """

    def __init__(self, database: MotionDatabase) -> None:
        self._database = database

    def plan(self, start: Posture, _rng: np.random.Generator) -> RisePlan:
        """Choose the motion whose first posture is nearest."""
        motions = self._database.motions
        metric = self._database.metric
        distance = metric.distance(
            start.orientation,
            start.joint_pos,
            np.array([m.orientation[0] for m in motions]),
            np.array([m.joint_pos[0] for m in motions]),
        )
        return as_it_is(motions[int(np.argmin(distance))], "the nearest stored motion")


class StoredMotion:
    """Chooses one motion, however the robot lies; the preflight may refuse it."""

    def __init__(self, motion: Motion) -> None:
        self._motion = motion

    def plan(self, _start: Posture, _rng: np.random.Generator) -> RisePlan:
        """Choose the motion."""
        return as_it_is(self._motion)


def as_it_is(motion: Motion, reason: str = "played as it is") -> RisePlan:
    """Make a plan of a motion that is played unchanged."""
    return RisePlan(status=RiseStatus.UNREHEARSED, reason=reason, motion=motion)
