"""Running outcomes: judge long runs of many robots without keeping whole records."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from humanoid_getup.experiments.judging.outcome import (
    Outcome,
    compute_rms,
    count_rising,
    find_impact,
)
from humanoid_getup.experiments.judging.record import Record
from humanoid_getup.experiments.judging.standing import judge
from robots import Robot
from robots.quaternion import Array

RECENT = 2.0  # s at the end, over which the speed of a stand is measured


@dataclass(frozen=True, kw_only=True, eq=False)
class RunFigures:
    """Figures of N runs of T samples, as :class:`Outcome` defines them."""

    upright: NDArray[np.bool_]
    """Whether the standing condition holds, (N, T); nowhere if the physics diverged."""
    stood: NDArray[np.bool_]
    """(N,)"""
    stand_time: Array
    """[s], nan without a stand, (N,)"""
    peak_torque: Array
    """[N·m], (N,)"""
    peak_braking_torque: Array
    """[N·m], (N,)"""
    rms_torque: Array
    """[N·m], (N,)"""
    head_impact: Array | None
    """[m/s], (N,)"""
    standing_speed: Array
    """RMS joint speed of the last 2 s [rad/s]; nan without a stand, (N,)."""


class RunningOutcome:
    """Takes the records of N runs piece by piece, and stores only the data of their figures."""

    def __init__(self, robot: Robot) -> None:
        self._robot, self._period = robot, robot.control_period
        self._peak, self._braking = np.zeros(1), np.zeros(1)
        self._upright: list[NDArray[np.bool_]] = []
        self._square: list[Array] = []
        """Mean square of the torques of a robot [(N·m)²]."""
        self._touch: list[NDArray[np.bool_]] = []
        self._head_speed: list[Array] = []
        self._joint_vel: list[Array] = []
        """Joint speeds of the last pieces."""
        self._diverged: NDArray[np.bool_] = np.zeros(1, dtype=bool)

    def add(self, record: Record) -> None:
        """Add the next piece of all runs."""
        outcome, self._period = Outcome(record, self._robot), record.period
        self._peak = np.maximum(self._peak, outcome.peak_torque)
        self._braking = np.maximum(self._braking, outcome.peak_braking_torque)
        self._upright.append(record.upright)
        self._square.append(np.mean(record.torque**2, axis=-1))
        if record.head_touch is not None and record.head_speed is not None:
            self._touch.append(record.head_touch)
            self._head_speed.append(record.head_speed)
        self._diverged = self._diverged | record.diverged
        self._joint_vel.append(record.joint_vel)
        while sum(piece.shape[1] for piece in self._joint_vel[1:]) >= self._recent:
            del self._joint_vel[0]

    def conclude(self) -> RunFigures:
        """Judge the runs."""
        upright = np.concatenate(self._upright, axis=1) & ~self._diverged[:, np.newaxis]
        stand = judge(upright, self._period)
        rising = count_rising(stand, self._period, upright.shape[1])
        impact = None
        if self._touch:
            touch = np.concatenate(self._touch, axis=1)
            impact = find_impact(touch, np.concatenate(self._head_speed, axis=1))
        recent = np.concatenate(self._joint_vel, axis=1)[:, -self._recent :]
        speed = np.sqrt(np.mean(recent**2, axis=(1, 2)))
        return RunFigures(
            upright=upright,
            stood=stand.stood,
            stand_time=stand.start_time,
            peak_torque=self._peak,
            peak_braking_torque=self._braking,
            rms_torque=compute_rms(np.concatenate(self._square, axis=1), rising),
            head_impact=impact,
            standing_speed=np.where(stand.stood, speed, np.nan),
        )

    @property
    def _recent(self) -> int:
        """Return how many samples are recent."""
        return round(RECENT / self._period)
