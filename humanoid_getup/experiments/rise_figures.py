"""Rise figures: what simulated rises took in time, torque, impact and self-collision."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from humanoid_getup.experiments.play import Trace
from humanoid_getup.simulation.world import World
from robots.quaternion import Array

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
        return RiseFigures(
            stand_time=stand_time,
            peak_torque=np.abs(trace.torque).max(axis=(1, 2)),
            rms_torque=_measure_rms(trace, stand_time),
            impact=compute_delta_v(neck, trace.period).max(axis=1),
            overlap=trace.overlap.max(axis=1),
        )

    def take(self, row: int) -> RiseFigures:
        """Return the figures of one rise."""
        return RiseFigures(**{f.name: getattr(self, f.name)[row] for f in fields(RiseFigures)})

    def record(self) -> dict[str, float]:
        """Return the figures of one rise under report.json's keys."""
        return {
            "stand_time_s": float(self.stand_time),
            "peak_torque_nm": float(self.peak_torque),
            "rms_torque_nm": float(self.rms_torque),
            "neck_delta_v_m_s": float(self.impact),
            "self_overlap_m": float(max(self.overlap, 0.0)),
        }

    @property
    def collides(self) -> np.ndarray:
        """Whether the robot touched itself firmly, (...)."""
        return self.overlap > DEEP_OVERLAP


def compute_delta_v(position: Array, period: float) -> Array:
    """Compute by how much a point's velocity changes within each period [m/s], (..., T - 2).

    Its positions [m], (..., T, 3), are sampled every period [s].
    """
    return np.linalg.norm(np.diff(position, n=2, axis=-2), axis=-1) / period


def _measure_rms(trace: Trace, stand_time: Array) -> Array:
    """Measure the RMS torque up to the stand; of the whole trace without one, (N,) [N·m]."""
    whole = trace.torque.shape[1]
    cycles = np.where(stand_time > 0.0, np.round(stand_time / trace.period), whole).astype(int)
    square = np.cumsum(np.mean(trace.torque**2, axis=2), axis=1)  # (N, T)
    cycles = np.clip(cycles, 1, whole)
    return np.sqrt(square[np.arange(len(square)), cycles - 1] / cycles)
