"""Cuts: where the commands that reached the servos were less than those of the controller."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from drivers.flight_log.reader import FlightRecord
from robots.quaternion import Array

# Servos round: a target to a tick of 1.5 mrad, a torque limit to a count of its current or PWM.
TARGET_ROUNDING = 0.005  # rad
TORQUE_ROUNDING = 0.05  # share of the limit
PAUSE = 0.1  # s between two cuts of one episode


class CutKind(Enum):
    """What was cut of a command."""

    TARGET = "target"
    TORQUE = "torque limit"
    RELEASE = "torque"


@dataclass(frozen=True, kw_only=True)
class Cut:
    """An episode in which the commands of some joints were cut."""

    kind: CutKind
    joints: tuple[str, ...]
    begin: float
    """Since the first cycle [s]."""
    end: float
    """Of its last cycle [s]."""
    largest: float
    """Largest difference [rad], or [N·m] of torque."""

    def __str__(self) -> str:
        count = len(self.joints)
        joints = f"joint '{self.joints[0]}'" if count == 1 else f"{count} joints"
        unit = "rad" if self.kind is CutKind.TARGET else "N·m"
        size = f"cut by up to {self.largest:.2f} {unit}"
        what = "switched off" if self.kind is CutKind.RELEASE else size
        return f"{joints}: {self.kind.value} {what}, until {self.end:.2f} s"


def find_cuts(record: FlightRecord) -> tuple[Cut, ...]:
    """Find the episodes in which commands were cut, by joint and kind, in the order of time.

    These are the clips of the guard, targets that it held for lack of a measurement, and torque
    that it switched off after a fault. Joints that were cut in the same cycles are one episode.
    """
    if not record.cycles:
        return ()
    time = record.time - record.time[0]
    cuts = list[Cut]()
    for kind, size in _compare(record).items():
        together: dict[tuple[int, int], list[int]] = {}
        for joint, column in enumerate(size.T):
            for episode in _find_episodes(column > 0.0, time):
                together.setdefault(episode, []).append(joint)
        cuts += [
            Cut(
                kind=kind,
                joints=tuple(record.joint_names[joint] for joint in joints),
                begin=float(time[first]),
                end=float(time[last]),
                largest=float(size[first : last + 1, joints].max()),
            )
            for (first, last), joints in together.items()
        ]
    return tuple(sorted(cuts, key=lambda cut: cut.begin))


def _compare(record: FlightRecord) -> dict[CutKind, Array]:
    """Return how much was cut of each joint in each cycle, (T, n), by kind; 0 for nothing."""
    shape = record.sent["joint_pos"].shape
    target, torque = (
        _in_shape(record.tracks["asked"][name], shape) for name in ("joint_pos", "torque_limit")
    )
    sent_target, sent_torque = record.sent["joint_pos"], record.sent["torque_limit"]
    is_driven = (torque > 0.0) & (sent_torque > 0.0)
    moved, missing = np.abs(target - sent_target), torque - sent_torque
    return {
        CutKind.TARGET: np.where(is_driven & (moved > TARGET_ROUNDING), moved, 0.0),
        CutKind.TORQUE: np.where(is_driven & (missing > TORQUE_ROUNDING * torque), missing, 0.0),
        CutKind.RELEASE: np.where((torque > 0.0) & (sent_torque == 0.0), torque, 0.0),
    }


def _in_shape(values: np.ndarray, shape: tuple[int, ...]) -> Array:
    """Return rows of a shape; a command of another length, which no guard passes, is NaN."""
    if values.shape == shape:
        return values.astype(float)
    rows = np.full(shape, np.nan)
    for row, value in zip(rows, values, strict=False):
        if np.shape(value) == row.shape:
            row[:] = np.asarray(value, dtype=float)
    return rows


def _find_episodes(flags: NDArray[np.bool_], time: Array) -> Iterator[tuple[int, int]]:
    """Yield the first and last cycle of each episode of flags (T,), without longer pauses."""
    cycles = np.flatnonzero(flags)
    if len(cycles):
        breaks = np.flatnonzero(np.diff(time[cycles]) > PAUSE) + 1
        for run in np.split(cycles, breaks):
            yield int(run[0]), int(run[-1])
