"""Outcomes: how runs ended, and their figures. Every figure is defined here alone."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import KW_ONLY, dataclass, replace
from functools import cached_property
from inspect import signature
from typing import TypeVar

import msgspec
import numpy as np
from numpy.typing import NDArray

from humanoid_getup.experiments.judging.record import Record
from humanoid_getup.experiments.judging.standing import HOLD_TIME, Stand, compute_uprightness, judge
from humanoid_getup.experiments.judging.torque import (
    LONG_SATURATION,
    SplitTorque,
    find_longest,
    find_saturation,
    limit_torque,
    split_torque,
)
from robots import Robot
from robots.quaternion import Array

DEEP_OVERLAP = 0.0001  # m; contacts are stiff: a touch this deep is firm, a collision
APART = 0.1  # s after which a collision or violation counts again
LIMIT_SLACK = np.radians(1.0)  # a soft joint stop yields this much
STRIDE = 0.1  # s between the samples of a detour
WINDOW = 25  # samples over which a robot has to be nearly upright to make progress

FIGURES = {
    "stand_time_s": "stand_time",
    "peak_torque_nm": "peak_torque",
    "peak_braking_torque_nm": "peak_braking_torque",
    "peak_velocity_rad_s": "peak_velocity",
    "torque_use": "torque_use",
    "rms_torque_nm": "rms_torque",
    "self_overlap_m": "overlap",
    "self_collisions": "self_collisions",
    "ground_penetrations": "ground_penetrations",
    "limit_violations": "limit_violations",
    "head_impact_m_s": "head_impact",
    "torso_impact_m_s": "torso_impact",
    "neck_delta_v_m_s": "neck_delta_v",
    "detour_rad": "detour",
    "height_lost": "height_lost",
    "jerk_rad_s3": "jerk",
}
"""Figures of load and contact, by their keys in reports."""

Bools = NDArray[np.bool_]
Counts = NDArray[np.int_]
Kind = TypeVar("Kind")


@dataclass(frozen=True, eq=False)
class Outcome:
    """How runs ended, and their figures, from a record; figures have the shape of its robots.

    That shape is () for a single run. A figure is computed when it is first asked for, and None if
    it could not be observed.
    """

    record: Record
    robot: Robot
    _: KW_ONLY
    torque_limit: float | None = None
    """[N·m]; ``None`` for the servos' own."""
    hold_time: float = HOLD_TIME
    """[s]; only a search whose results are checked again may use a shorter one."""

    def take(self, rows: NDArray[np.int_] | slice | int) -> Outcome:
        """Return the outcomes of some runs, or of one, by the first axis."""
        return replace(self, record=self.record.take(rows))

    def settle(self) -> Outcome:
        """Return the outcome of a run that was stopped because the robot stands steadily."""
        settled = np.ones_like(self.record.settled)
        return replace(self, record=replace(self.record, settled=settled))

    @cached_property
    def stand(self) -> Stand:
        """Return whether, when and for how long the robot stood at the end."""
        record = self.record
        return judge(
            record.upright,
            record.period,
            self.hold_time,
            cycles=record.cycles,
            settled=record.settled,
            failed=record.failed,
        )

    @property
    def stood(self) -> Bools:
        """Return whether it ended in a held stand."""
        return self.stand.stood

    @property
    def stand_time(self) -> Array:
        """Return the time from the start to the first moment of the held stand [s]; else nan."""
        return self.stand.start_time

    @cached_property
    def rising(self) -> Counts:
        """Return the number of samples of the way up: to the stand, or to the end without one."""
        return count_rising(self.stand, self.record.period, self.record.cycles)

    @cached_property
    def progress(self) -> Array:
        """Return the progress to a stand, from 0 to 1: mostly that at the end, partly the best."""
        near = compute_uprightness(self.record.stance, self.robot)
        size = min(WINDOW, near.shape[-1])
        if not size:
            return np.zeros(near.shape[:-1])[()]
        whole = near[..., near.shape[-1] % size :]  # the last window ends with the record
        means = whole.reshape(*near.shape[:-1], -1, size).mean(axis=-1)
        last = means.shape[-1] - 1 - (near.shape[-1] - self.record.cycles) // size  # (...)
        means = np.where(np.arange(means.shape[-1]) <= last[..., np.newaxis], means, 0.0)
        at_end = np.take_along_axis(means, last[..., np.newaxis], axis=-1)[..., 0]
        return np.where(self.stood, 1.0, compute_progress(at_end, means.max(axis=-1)))

    @cached_property
    def torques(self) -> SplitTorque:
        """Return driving and braking torques, (..., T, n)."""
        return split_torque(self.record.torque, self.record.actuator_vel)

    @cached_property
    def peak_torque(self) -> Array:
        """Return the greatest torque with which a servo drove its joint [N·m]."""
        return self.torques.driving.max(axis=(-2, -1), initial=0.0)

    @cached_property
    def peak_braking_torque(self) -> Array:
        """Return the greatest torque with which a servo was turned from outside [N·m]."""
        return self.torques.braking.max(axis=(-2, -1), initial=0.0)

    @cached_property
    def torque_use(self) -> Array:
        """Return the largest driving torque of any servo as a share of its limit."""
        limit = limit_torque(self.robot, self.torque_limit)
        return (self.torques.driving / limit).max(axis=(-2, -1), initial=0.0)

    @cached_property
    def rms_torque(self) -> Array:
        """Return the RMS torque on the way up, over all joints [N·m]."""
        return compute_rms(np.mean(self.record.torque**2, axis=-1), self.rising)

    @cached_property
    def peak_velocity(self) -> Array:
        """Return the greatest speed of a joint [rad/s]."""
        return np.abs(self.record.joint_vel).max(axis=(-2, -1), initial=0.0)

    @cached_property
    def saturation(self) -> Array:
        """Return the longest time during which a servo had all the torque of its supply [s]."""
        record = self.record
        saturated = find_saturation(
            self.robot, record.torque, record.actuator_vel, record.voltage[..., np.newaxis]
        )
        return find_longest(saturated).max(axis=-1) * record.period

    @property
    def overloaded(self) -> Bools:
        """Return whether a servo's overload protection may trip."""
        return self.saturation > LONG_SATURATION

    @cached_property
    def limit_violations(self) -> Counts:
        """Return how often a joint left its range."""
        robot = self.robot
        angles = self.record.joint_pos
        beyond = np.maximum(robot.lower - angles, angles - robot.upper) > LIMIT_SLACK
        return self._count_episodes(beyond.any(axis=-1))

    @cached_property
    def overlap(self) -> Array | None:
        """Return the greatest depth of self-penetration [m]."""
        depth = self.record.overlap
        return None if depth is None else depth.max(axis=-1, initial=0.0)

    @property
    def collides(self) -> Bools | None:
        """Return whether the robot touched itself firmly."""
        return None if self.overlap is None else self.overlap > DEEP_OVERLAP

    @cached_property
    def self_collisions(self) -> Counts | None:
        """Return how often the robot touched itself firmly."""
        depth = self.record.overlap
        return None if depth is None else self._count_episodes(depth > DEEP_OVERLAP)

    @cached_property
    def ground_penetrations(self) -> Counts | None:
        """Return how often the robot pressed deeper into the ground than at rest."""
        depth = self.record.ground_depth
        return None if depth is None else self._count_episodes(depth > 0.0)

    @cached_property
    def head_impact(self) -> Array | None:
        """Return the greatest speed at which the head hit the ground [m/s]."""
        return find_impact(self.record.head_touch, self.record.head_speed)

    @cached_property
    def torso_impact(self) -> Array | None:
        """Return the greatest speed of the torso's faster end as it hit the ground [m/s]."""
        return find_impact(self.record.torso_touch, self.record.torso_speed)

    @cached_property
    def neck_delta_v(self) -> Array | None:
        """Return the largest change of the neck's velocity in a period on the way up [m/s]."""
        record = self.record
        if record.is_sensed:
            return None
        change = np.linalg.norm(np.diff(record.neck, n=2, axis=-2), axis=-1) / record.period
        at = np.arange(2, record.neck.shape[-2])
        return np.where(at < self.rising[..., np.newaxis], change, 0.0).max(axis=-1, initial=0.0)

    @cached_property
    def detour(self) -> Array:
        """Return the angle by which the torso turned on the way up, beyond the direct one [rad]."""
        turns, last = self._sample_rising(self.record.orientation)
        if not turns.shape[-2]:
            return np.zeros(turns.shape[:-2])[()]
        steps = _measure_turns(turns[..., :-1, :], turns[..., 1:, :])
        end = np.take_along_axis(turns, last[..., np.newaxis, np.newaxis], axis=-2)[..., 0, :]
        return _sum_until(steps, last) - _measure_turns(turns[..., 0, :], end)

    @cached_property
    def height_lost(self) -> Array:
        """Return the height by which the neck sank again on the way up [standing heights]."""
        heights, last = self._sample_rising(self.record.stance.neck_height[..., np.newaxis])
        sunk = np.maximum(-np.diff(heights[..., 0], axis=-1), 0.0)
        return _sum_until(sunk, last) / self.robot.standing_neck_height

    @cached_property
    def jerk(self) -> Array:
        """Return the RMS jerk on the way up, over all joints [rad/s³]."""
        change = np.diff(self.record.joint_vel, n=2, axis=-2) / self.record.period**2
        return compute_rms(np.mean(change**2, axis=-1), np.maximum(self.rising - 2, 1))

    def _sample_rising(self, rows: Array) -> tuple[Array, Counts]:
        """Sample rows (..., T, k) on the way up; return them, and the place of the last."""
        step = max(round(STRIDE / self.record.period), 1)
        some = rows[..., ::step, :]
        return some, np.clip(self.rising // step, 0, max(some.shape[-2] - 1, 0))

    @property
    def qpos(self) -> Array:
        """Return the MuJoCo positions, (..., T, nq)."""
        return self.record.qpos

    @property
    def is_sensed(self) -> bool:
        """Return whether it is judged by sensors alone: torques are estimated, contacts unknown."""
        return self.record.is_sensed

    def figures(self, kind: Callable[..., Kind]) -> Kind:
        """Make something of those figures of one run that it takes, under their keys in reports."""
        keys = signature(kind).parameters.keys() & FIGURES.keys()
        found = {key: getattr(self, FIGURES[key]) for key in keys}
        return kind(**{k: None if v is None else np.asarray(v).item() for k, v in found.items()})

    def _count_episodes(self, present: Bools) -> Counts:
        """Count the episodes of flags (..., T), joined across short gaps, (...)."""
        apart = round(APART / self.record.period)
        present = present & (np.arange(present.shape[-1]) < self.record.cycles[..., np.newaxis])
        return count_episodes(present, apart)


def _measure_turns(q1: Array, q2: Array) -> Array:
    """Measure the angle between orientations (..., 4) [rad], (...)."""
    return 2.0 * np.arccos(np.minimum(np.abs(np.sum(q1 * q2, axis=-1)), 1.0))


def _sum_until(steps: Array, last: Counts) -> Array:
    """Sum the first ``last`` of some steps (..., T), (...)."""
    return np.where(np.arange(steps.shape[-1]) < last[..., np.newaxis], steps, 0.0).sum(axis=-1)


def count_rising(stand: Stand, period: float, cycles: Counts | int) -> Counts:
    """Count the samples of ``period`` [s] up to a stand, or all ``cycles`` without one, (...)."""
    to_stand = np.nan_to_num(stand.start_time / period)
    return np.where(stand.stood, np.round(to_stand).astype(int), cycles)


def compute_rms(mean_square: Array, count: Counts) -> Array:
    """Compute the root of the mean of the first samples of mean squares (..., T), (...)."""
    square = np.cumsum(mean_square, axis=-1)
    if not square.shape[-1]:
        return np.zeros(square.shape[:-1])[()]
    count = np.clip(count, 1, square.shape[-1])
    total = np.take_along_axis(square, count[..., np.newaxis] - 1, axis=-1)[..., 0]
    return np.sqrt(total / count)


def count_episodes(present: Bools, apart: int) -> Counts:
    """Count the episodes of flags (..., T) that are more than ``apart`` samples apart, (...)."""
    at = np.arange(1, present.shape[-1] + 1)
    last = np.maximum.accumulate(np.where(present, at, -apart), axis=-1)
    before = np.concatenate([np.full_like(last[..., :1], -apart), last[..., :-1]], axis=-1)
    return np.sum(present & (at - before > apart), axis=-1)


def compute_share(stood: Bools, undisturbed: int = 1) -> float:
    """Compute the share of runs (K,) that stood; 0 if not all of the first, undisturbed ones."""
    return float(stood.mean()) if stood[:undisturbed].all() else 0.0


def compute_progress(last: Array, best: Array) -> Array:
    """Compute the progress to a stand, from 0 to 1, from the last and the best uprightness."""
    return 0.6 * last + 0.4 * best


def find_impact(touch: Bools | None, speed: Array | None) -> Array | None:
    """Find the greatest speed (..., T) [m/s], one sample before, at which contacts began.

    A contact at the start is not an impact.
    """
    if touch is None or speed is None:
        return None
    begins = touch[..., 1:] & ~touch[..., :-1]
    return np.where(begins, speed[..., :-1], 0.0).max(axis=-1, initial=0.0)


class JointFigures(msgspec.Struct, frozen=True, kw_only=True):
    """Figures of a run, as reports name them; torques are estimated from currents."""

    peak_torque_nm: float
    """Greatest torque with which a servo drove its joint [N·m]."""
    peak_braking_torque_nm: float
    """Greatest torque with which a servo was turned from outside [N·m]."""
    rms_torque_nm: float
    """RMS over all joints and the whole run [N·m]."""
    torque_use: float
    """Largest driving torque of any servo as a share of its limit."""
    peak_velocity_rad_s: float
    """[rad/s]"""
    limit_violations: int
    """Number of times a joint left its range."""

    def __str__(self) -> str:
        """Describe the load of the servos in one line."""
        return (
            f"peak about {self.peak_torque_nm:.2f} N·m ({self.torque_use:.0%} of the limit), RMS "
            f"{self.rms_torque_nm:.2f} N·m, peak {self.peak_velocity_rad_s:.1f} rad/s"
        )
