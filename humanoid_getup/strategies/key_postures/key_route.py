"""Routes through key postures: planned paths, and stretches of stored motions that lead there.

A path of postures alone rolls no robot over and sits none up; a stored motion does. So a key
posture is approached on a path, or by the motion that passes nearest to it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from humanoid_getup.filtering.reference import align_motion
from humanoid_getup.motions.motion import Motion, Trajectory, join
from humanoid_getup.motions.motion_database import MotionDatabase
from humanoid_getup.simulation.world import World
from robots import Posture, quaternion
from robots.quaternion import Array


@dataclass(frozen=True, kw_only=True)
class Stretch:
    """A stretch of a stored motion that leads from near one posture to near another."""

    motion: Motion
    first: int
    last: int
    distance: float
    """Posture metric from the one posture to its first frame and from its last to the other."""


def find_stretches(
    database: MotionDatabase, start: Posture, key: Posture, count: int
) -> list[Stretch]:
    """Find the stretches of stored motions, one of each, that lead nearest from start to key.

    They begin at an entry frame.
    """
    metric, found = database.metric, list[Stretch]()
    for motion in database.rising:
        far = metric.distance(key.orientation, key.joint_pos, motion.orientation, motion.joint_pos)
        last = int(np.argmin(far))
        entries = motion.entry_frames[motion.entry_frames < last]
        if len(entries) == 0:
            continue
        near = metric.distance(
            start.orientation,
            start.joint_pos,
            motion.orientation[entries],
            motion.joint_pos[entries],
        )
        row = int(np.argmin(near))
        found.append(
            Stretch(
                motion=motion,
                first=int(entries[row]),
                last=last,
                distance=float(far[last] + near[row]),
            )
        )
    return sorted(found, key=lambda stretch: stretch.distance)[:count]


class Route:
    """A motion that is put together of paths, rests and stretches of stored motions."""

    def __init__(self, world: World, start: Posture) -> None:
        """Begin at a posture in the world, at rest, without load."""
        self._world, self._period = world, world.robot.control_period
        self._rows = _Rows.of(start)

    @property
    def posture(self) -> Posture:
        """Return the posture that it has come to."""
        return self._rows.posture(-1)

    @property
    def length(self) -> int:
        """Return the number of its rows, one for each control period."""
        return len(self._rows.joint_pos)

    def follow(self, path: Trajectory) -> None:
        """Follow a path from the present posture, at rest at both ends.

        The targets lead as those of a path do, and by the present load.
        """
        if len(path.time) < 2:
            return
        speed = np.gradient(path.joint_pos, self._period, axis=0)
        target = path.joint_pos + self._world.robot.compute_lag(speed) + self._load
        added = _Rows(path.position, path.orientation, path.joint_pos, target)
        self._rows = self._rows.then(added.drop_first())

    def rest(self, duration: float) -> None:
        """Hold the present posture and load for a time [s]."""
        count, rows = round(duration / self._period), self._rows
        target = np.tile(rows.joint_pos[-1] + self._load, (count, 1))
        self._rows = rows.then(
            _Rows(
                np.tile(rows.position[-1], (count, 1)),
                np.tile(rows.orientation[-1], (count, 1)),
                np.tile(rows.joint_pos[-1], (count, 1)),
                target,
            )
        )

    def play(self, motion: Motion, first: int, last: int | None = None) -> None:
        """Play a stored motion between two frames from the present posture; its load fades in."""
        position, orientation = align_motion(motion, first, self.posture)
        target = join(motion, first, self._rows.target[-1], self._period)
        rows = np.minimum(np.arange(len(target)) + first, len(motion.time) - 1)
        end = len(target) if last is None else last - first + 1
        rows = rows[:end]
        added = _Rows(position[rows], orientation[rows], motion.joint_pos[rows], target[:end])
        self._rows = self._rows.then(added.drop_first())

    def to_motion(self, like: Motion) -> Motion:
        """Make a motion of it, with the name and kind of the one that it ends with."""
        rows = self._rows
        return replace(
            like,
            time=np.arange(self.length, dtype=float) * self._period,
            position=rows.position,
            orientation=quaternion.normalize(rows.orientation),
            joint_pos=rows.joint_pos,
            joint_target=rows.target,
            entry=np.zeros(0, dtype=bool),
        )

    @property
    def _load(self) -> Array:
        """Return by how much the targets lead the angles for the load at present [rad], (n,)."""
        return self._rows.target[-1] - self._rows.joint_pos[-1]


@dataclass(frozen=True)
class _Rows:
    position: Array
    orientation: Array
    joint_pos: Array
    target: Array

    @classmethod
    def of(cls, posture: Posture) -> _Rows:
        angles = posture.joint_pos[None]
        return cls(posture.position[None], posture.orientation[None], angles, angles)

    def posture(self, row: int) -> Posture:
        return Posture(
            position=self.position[row],
            orientation=quaternion.normalize(self.orientation[row]),
            joint_pos=self.joint_pos[row],
        )

    def drop_first(self) -> _Rows:
        return _Rows(*(rows[1:] for rows in self._all()))

    def then(self, other: _Rows) -> _Rows:
        pairs = zip(self._all(), other._all(), strict=True)
        return _Rows(*(np.concatenate(pair) for pair in pairs))

    def _all(self) -> tuple[Array, ...]:
        return self.position, self.orientation, self.joint_pos, self.target
