"""The end of a motion: the time for which it is held, and its success."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from humanoid_getup.experiments.judging.lying import LYING_TIME, MAX_HEAD_IMPACT, measure_lying
from humanoid_getup.experiments.judging.outcome import Outcome
from humanoid_getup.experiments.judging.standing import HOLD
from humanoid_getup.motions.motion import NO_END, STANDING, Motion

REST = LYING_TIME + 0.5  # s; a robot may move on for a moment before it lies still


def hold_time(motion: Motion) -> float:
    """Return how long the end of a motion is held for judging [s]."""
    if motion.end_class == NO_END:
        return 0.0
    return HOLD if motion.rises else REST


def has_succeeded(motion: Motion, outcome: Outcome) -> NDArray[np.bool_]:
    """Return whether runs of a motion ended in a held stand, or lying softly on its side, (...).

    A path has no intended end, so it always succeeds.
    """
    if motion.end_class == STANDING:
        return outcome.stood
    if motion.end_class == NO_END:
        return np.ones_like(outcome.record.diverged)
    lies = measure_lying(outcome.record, motion.end_class).lies
    impact = outcome.head_impact
    return lies if impact is None else lies & (impact <= MAX_HEAD_IMPACT)


def describe_end(motion: Motion) -> str:
    """Describe the intended end of a motion."""
    if motion.end_class == NO_END:
        return "anywhere"
    return "in a held stand" if motion.rises else f"lying {motion.end_class}, softly and still"
