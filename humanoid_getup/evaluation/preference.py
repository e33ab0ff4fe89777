"""Preferences: what a rise should be besides successful, as weighted costs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from humanoid_getup.simulation.rollout import Trace
from humanoid_getup.simulation.world import World
from robots.quaternion import Array

PreferenceName = Literal["time", "torque", "impact", "robustness"]
PREFERENCE_NAMES: tuple[PreferenceName, ...] = get_args(PreferenceName)

DEEP_OVERLAP = 0.0001  # m; contacts are stiff: a touch this deep is firm, a collision


@dataclass(frozen=True, kw_only=True, eq=False)
class RiseFigures:
    """What rises took, up to their end; all arrays have one shape (...)."""

    stand_time: Array
    """Start to the first moment of the held stand [s]; nan without one."""
    peak_torque: Array
    """Largest torque of any servo [N·m]."""
    rms_torque: Array
    """Over time up to the stand, or to the end without one, and servos [N·m]."""
    impact: Array
    """Largest change of the neck's velocity within a control period [m/s]."""
    overlap: Array
    """Greatest depth of self-penetration [m]."""

    @staticmethod
    def of_trace(trace: Trace, world: World, stand_time: Array) -> RiseFigures:
        """Measure N rollouts that stand from times (N,) [s] on."""
        neck = trace.site_pos[:, :, world.model.site(world.robot.neck_site).id]
        change = np.linalg.norm(np.diff(neck, n=2, axis=1), axis=2) / trace.period
        return RiseFigures(
            stand_time=stand_time,
            peak_torque=np.abs(trace.torque).max(axis=(1, 2)),
            rms_torque=_measure_rms(trace, stand_time),
            impact=change.max(axis=1),
            overlap=trace.overlap.max(axis=1),
        )

    @property
    def collides(self) -> np.ndarray:
        """Whether the robot touched itself firmly, (...)."""
        return self.overlap > DEEP_OVERLAP


def _measure_rms(trace: Trace, stand_time: Array) -> Array:
    """Measure the RMS torque up to the stand; of the whole trace without one, (N,) [N·m]."""
    whole = trace.torque.shape[1]
    cycles = np.where(stand_time > 0.0, np.round(stand_time / trace.period), whole).astype(int)
    square = np.cumsum(np.mean(trace.torque**2, axis=2), axis=1)  # (N, T)
    cycles = np.clip(cycles, 1, whole)
    return np.sqrt(square[np.arange(len(square)), cycles - 1] / cycles)


@dataclass(frozen=True, kw_only=True)
class Preference:
    """Costs of a rise, in seconds: what a unit of each figure is worth in time to the stand."""

    time: float
    """Of a second until the stand."""
    rms_torque: float = 0.0
    """Of 1 N·m."""
    peak_torque: float = 0.0
    """Of 1 N·m."""
    impact: float = 0.0
    """Of 1 m/s."""
    collision: float = 1.0
    """Of touching itself firmly, however often."""
    overlap: float = 1000.0
    """Of 1 m of self-penetration."""
    improvement: float = 0.5
    """Share of the search's budget that may be spent on a rise that stands."""
    is_insatiable: bool = False
    """Whether a rise that stands without touching itself can still be too expensive."""
    wants_margin: bool = False
    """Whether it should stand under harder disturbances than those of the check."""

    @property
    def is_demanding(self) -> bool:
        """Whether the first rise that stands without touching itself need not be good enough."""
        return self.is_insatiable or self.wants_margin

    @staticmethod
    def of(name: PreferenceName) -> Preference:
        """Return a preference by name.

        Raises:
            ValueError: if it is unknown.
        """
        if name not in PREFERENCES:
            expected = ", ".join(PREFERENCE_NAMES)
            raise ValueError(f"prefer is {name!r}, expected one of {expected}")
        return PREFERENCES[name]

    def cost(self, figures: RiseFigures) -> Array:
        """Weigh rises, (...) [s]; nan for one that did not stand."""
        return (
            self.time * figures.stand_time
            + self.rms_torque * figures.rms_torque
            + self.peak_torque * figures.peak_torque
            + self.impact * figures.impact
            + self.collision * figures.collides
            + self.overlap * np.maximum(figures.overlap, 0.0)
        )


PREFERENCES: dict[PreferenceName, Preference] = {
    "time": Preference(time=1.0, improvement=0.3),
    "torque": Preference(time=0.1, rms_torque=8.0, peak_torque=1.0, is_insatiable=True),
    "impact": Preference(time=0.1, rms_torque=2.0, impact=10.0, is_insatiable=True),
    "robustness": Preference(time=0.3, wants_margin=True),
}
