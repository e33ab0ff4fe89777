"""Key postures in a motion: times and errors at which it passes them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import msgspec
import numpy as np
from msgspec import UNSET, UnsetType

from humanoid_getup.simulation.world import World
from robots import Posture, quaternion
from robots.quaternion import Array

CLOSE_JOINT = 0.1  # rad; largest joint error of a key posture that counts as kept
CLOSE_TILT = 0.35  # rad between the directions of gravity in the torso, likewise


@dataclass(frozen=True, kw_only=True, eq=False)
class KeyPass:
    """The instant at which a robot comes closest to a key posture."""

    frame: int
    joint_error: Array
    """Key posture minus joint angles [rad], (n,)."""
    tilt: float
    """Angle between the directions of gravity in the two torso frames [rad]."""

    @property
    def largest(self) -> float:
        """Return the largest joint error [rad]."""
        return float(np.abs(self.joint_error).max())

    @property
    def distance(self) -> float:
        """Return the distance of the posture from the key; up to 1 the key is kept."""
        return max(self.largest / CLOSE_JOINT, self.tilt / CLOSE_TILT)

    @property
    def is_kept(self) -> bool:
        """Return whether the key counts as kept."""
        return self.distance <= 1.0


class KeyFigures(msgspec.Struct, frozen=True, kw_only=True):
    """Result of a key posture in a plan, under report.json's keys."""

    name: str
    kept: bool
    time_s: float | None = None
    """Time at which the motion passes it; ``None`` if it does not."""
    largest_joint_error_rad: float | None = None
    """Largest joint error at that instant of the undisturbed rollout."""
    tilt_error_rad: float | None = None
    """Tilt error of the torso at that instant."""
    reason: str = ""
    """Reason why it was dropped; empty if it was kept."""
    played_joint_error_rad: float | UnsetType | None = UNSET
    """Largest joint error in the rise itself; unset if only the plan is known."""


@dataclass(frozen=True, kw_only=True, eq=False)
class KeyRecord:
    """A key posture, and its result in a plan."""

    posture: Posture
    figures: KeyFigures


def find_passes(world: World, qpos: Array, keys: Sequence[Posture]) -> list[KeyPass]:
    """Find the times at which a robot is closest to each of several key postures, in order.

    Of all ordered instants those are taken whose distances have the least sum. MuJoCo positions
    have the shape (T, nq), one row for each control period.
    """
    layout = world.robot.layout(world.model)
    error = np.array([key.joint_pos - qpos[:, layout.qpos] for key in keys])  # (K, T, n)
    gravity = quaternion.gravity_in_body(qpos[:, layout.root_orientation])
    down = np.array([key.gravity_b for key in keys])
    tilt = np.arccos(np.clip(down @ gravity.T, -1.0, 1.0))  # (K, T)
    distance = np.maximum(np.abs(error).max(axis=2) / CLOSE_JOINT, tilt / CLOSE_TILT)
    frames = _pick_in_order(distance)
    return [
        KeyPass(frame=frame, joint_error=error[k, frame], tilt=float(tilt[k, frame]))
        for k, frame in enumerate(frames)
    ]


def _pick_in_order(distance: Array) -> list[int]:
    """Pick non-decreasing columns in the rows of (K, T) with the smallest sum."""
    total = np.zeros_like(distance)
    before = np.zeros(distance.shape[1])
    for k, row in enumerate(distance):
        total[k] = row + before
        before = np.minimum.accumulate(total[k])
    frames, last = list[int](), distance.shape[1] - 1
    for row in total[::-1]:
        last = int(np.argmin(row[: last + 1]))
        frames.append(last)
    return frames[::-1]
