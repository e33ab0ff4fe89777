"""Candidates: a path with a motion, and their rollouts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from humanoid_getup.experiments.judging.outcome import Outcome
from humanoid_getup.motions.motion import Trajectory
from humanoid_getup.motions.motion_database import Connection
from robots.quaternion import Array


@dataclass(frozen=True, kw_only=True)
class Slowdown:
    """How a motion slows down for servos that lag behind their targets.

    A servo under load stays behind its target by its torque over its stiffness; beyond the largest
    torque it does not follow at all, and a motion that continues regardless leaves the robot
    behind. So the motion runs the more slowly, the farther the slowest joint is behind.
    """

    tolerance: float
    """Lag up to which the motion runs at its own speed [rad]."""
    band: float
    """Lag beyond that at which it would stop [rad]."""
    slowest: float
    """Smallest speed, as a share of its own."""


@dataclass(frozen=True, kw_only=True)
class Candidate:
    """A path and a motion to be rolled out."""

    path: Trajectory
    """From the lying posture to the connecting one."""
    connection: Connection
    tempo: float = 1.0
    """Speed of the path as a share of the planned one."""
    slowdown: Slowdown | None = None
    """How it slows down for servos that lag behind; ``None``: not at all."""
    assistance: float = 1.0
    """Share of the filter's virtual actuator; 0 is plain tracking."""
    before: Array | None = None
    """Targets to send first [rad], (T, n): those of an earlier rollout, at whose end the path
    begins."""
    seen: Array | None = None
    """Positions and orientations (K, 7) of the root in an earlier rollout, from where the motion
    is joined: where the legs fit the ground."""


@dataclass(frozen=True, kw_only=True)
class CandidateRollout:
    """Rollout of a candidate."""

    candidate: Candidate
    outcome: Outcome
    """A stand of one second counts in it; a check requires more."""
    cost: float
    """By the filter's preference [s]; nan if it did not stand."""
    moving: int
    """Cycles before the targets stand still."""
    joined: int
    """Cycle at which the motion was joined."""
    stood: bool
    """Whether it ended upright for a second, and no servo was overloaded."""
    collides: bool
    """Whether the robot touched itself firmly."""
    peak_neck: float
    """Greatest neck height reached [m]."""
    target: Array
    """Targets that the servos were sent [rad], (T, n)."""
    overlap: Array
    """Depth of self-penetration [m], (T,)."""

    @property
    def qpos(self) -> Array:
        """MuJoCo positions, (T, nq)."""
        return self.outcome.record.qpos

    def measure_overlap(self, touch: float) -> float:
        """Sum the depths of self-overlap beyond a touch [m]."""
        return float(np.maximum(self.overlap - touch, 0.0).sum())


NO_SLOWDOWN = Slowdown(tolerance=np.inf, band=1.0, slowest=1.0)
