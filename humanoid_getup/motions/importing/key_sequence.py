"""Key sequences: postures and the times between them, from another program."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from humanoid_getup.motions.motion import MAX_DURATION
from robots import Robot
from robots.quaternion import Array

MOST_KEYS = 120
"""Keys of a sequence; one with more is a recording, not keys."""


@dataclass(frozen=True, kw_only=True)
class KeySequence:
    """Key postures of one motion and the times between them."""

    name: str
    source: str
    """Its source, for messages."""
    keys: Array
    """Joint angles [rad], shape (K, n), in the robot's joint order."""
    after: Array
    """Time from each key to the next [s], shape (K-1,), above 0."""
    notes: tuple[str, ...] = ()
    """Messages about content that keys cannot express."""


@dataclass(kw_only=True)
class KeyCollector:
    """Collects keys in order; joints that a key omits keep their last angles.

    Joints that are not in the first key stand as in the robot's stance.
    """

    robot: Robot
    keys: list[Array] = field(default_factory=list)
    after: list[float] = field(default_factory=list)

    def add(self, move: float, angles: Mapping[int, float], pause: float = 0.0) -> None:
        """Add a key that is reached in ``move`` and held for ``pause`` [s].

        A move of no time is given one control period.
        """
        posture = (self.keys[-1] if self.keys else self.robot.standing.joint_pos).copy()
        for joint, angle in angles.items():
            posture[joint] = angle
        if self.keys:
            self.after.append(max(move, self.robot.control_period))
        self.keys.append(posture)
        if pause > 0.0:
            self.keys.append(posture)
            self.after.append(pause)

    def finish(self, name: str, source: str, notes: tuple[str, ...] = ()) -> KeySequence:
        """Return the sequence."""
        duration = sum(self.after)
        if not self.keys:
            raise ValueError(f"{source} has no keys, expected one or more")
        if len(self.keys) > MOST_KEYS:
            raise ValueError(f"{source} has {len(self.keys)} keys, expected at most {MOST_KEYS}")
        if duration > MAX_DURATION:
            raise ValueError(
                f"{source} lasts {duration:.4g} s, expected at most {MAX_DURATION:g} s"
            )
        return KeySequence(
            name=name,
            source=source,
            keys=np.array(self.keys),
            after=np.array(self.after),
            notes=notes,
        )
