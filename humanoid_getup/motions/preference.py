"""Preferences of a rise, as weighted costs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from humanoid_getup.experiments.judging.outcome import Outcome
from robots.quaternion import Array

PreferenceName = Literal["time", "torque", "impact", "robustness", "natural"]
PREFERENCE_NAMES: tuple[PreferenceName, ...] = get_args(PreferenceName)


@dataclass(frozen=True, kw_only=True)
class Preference:
    """Costs of a rise in seconds: the weight of each figure, as time to the stand."""

    time: float
    """Of a second until the stand."""
    rms_torque: float = 0.0
    """Of 1 N·m."""
    peak_torque: float = 0.0
    """Of 1 N·m, driving or braking."""
    neck_delta_v: float = 0.0
    """Of 1 m/s by which the neck's velocity changes at once."""
    detour: float = 0.0
    """Of 1 rad by which the torso turns beyond the direct way."""
    height_lost: float = 0.0
    """Of a standing height by which the neck sinks again."""
    jerk: float = 0.0
    """Of 1000 rad/s³ RMS."""
    collision: float = 1.0
    """Of any firm self-contact, however often."""
    overlap: float = 1000.0
    """Of 1 m of self-penetration."""
    improvement: float = 0.5
    """Share of the search's budget that may be spent on a rise that stands."""
    always_improves: bool = False
    """Whether a rise that stands without self-contact is made cheaper until the budget ends."""
    wants_margin: bool = False
    """Whether it should also stand under harder disturbances than those of the check."""

    @property
    def is_demanding(self) -> bool:
        """Return whether the search continues after a first stand without self-contact."""
        return self.always_improves or self.wants_margin

    @staticmethod
    def of(name: PreferenceName) -> Preference:
        """Return a preference by name."""
        if not isinstance(name, str) or name not in PREFERENCES:
            expected = ", ".join(PREFERENCE_NAMES)
            raise ValueError(f"prefer is {name!r}, expected one of {expected}")
        return PREFERENCES[name]

    def cost(self, outcome: Outcome, time: Array | None = None) -> Array:
        """Compute the cost of simulated runs, (...) [s], with the time [s] that they took.

        None for the time to the stand; the cost of one that did not stand is nan then.
        """
        time = outcome.stand_time if time is None else time
        peak = np.maximum(outcome.peak_torque, outcome.peak_braking_torque)
        return (
            self.time * time
            + self.rms_torque * outcome.rms_torque
            + self.peak_torque * peak
            + self.neck_delta_v * np.asarray(outcome.neck_delta_v)
            + self.collision * np.asarray(outcome.collides)
            + self.overlap * np.asarray(outcome.overlap)
            + (self._weigh_detours(outcome) if self.detour else 0.0)
        )

    def _weigh_detours(self, outcome: Outcome) -> Array:
        return (
            self.detour * outcome.detour
            + self.height_lost * outcome.height_lost
            + self.jerk * outcome.jerk / 1000.0
        )


PREFERENCES: dict[PreferenceName, Preference] = {
    "time": Preference(time=1.0, improvement=0.3),
    "torque": Preference(time=0.1, rms_torque=8.0, peak_torque=1.0, always_improves=True),
    "impact": Preference(time=0.1, rms_torque=2.0, neck_delta_v=10.0, always_improves=True),
    "robustness": Preference(time=0.3, wants_margin=True),
    "natural": Preference(time=0.3, detour=1.0, height_lost=4.0, jerk=0.2),
}
