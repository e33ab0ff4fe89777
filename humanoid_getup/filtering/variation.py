"""Variations: a motion's targets, changed in tempo and posture by a few numbers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robots import Robot
from robots.quaternion import Array

STRETCHES = 6  # of equal duration, each with a tempo and a posture of its own
UNIT_TEMPO, UNIT_OFFSET = 0.3, 0.15  # logarithm of a duration, and rad: 1 in a gene
LONGEST, SHORTEST = 2.1, 0.5  # share of its own duration that a stretch may last


@dataclass(frozen=True, kw_only=True)
class Variation:
    """Change of targets against those at the start of a search."""

    tempo: Array
    """Logarithm of the factor on the duration of each stretch, (STRETCHES,)."""
    offset: Array
    """Offset of each pair of joints at the knots [rad], (STRETCHES, pairs). The knots divide the
    motion evenly; at its first and last target there is no offset."""

    @staticmethod
    def size(robot: Robot) -> int:
        """Return the count of numbers in a variation."""
        return STRETCHES * (1 + len(pair_directions(robot)))

    @staticmethod
    def of(genes: Array) -> Variation:
        """Read a variation from its numbers (size,); 1 is a large change, 0 is none."""
        offset = UNIT_OFFSET * genes[STRETCHES:]
        return Variation(tempo=UNIT_TEMPO * genes[:STRETCHES], offset=offset.reshape(STRETCHES, -1))

    def apply(self, target: Array, start: Array, robot: Robot) -> Array:
        """Change targets [rad], (T, n), that are sent from joint angles (n,) on.

        The result keeps the joints' limits and the servos' speed.
        """
        last = len(target) - 1
        ends = np.linspace(0.0, last, STRETCHES + 1)
        stretch = np.clip(np.exp(self.tempo), SHORTEST, LONGEST)
        clock = np.concatenate([[0.0], np.cumsum(np.diff(ends) * stretch)])
        at = np.interp(np.arange(int(np.ceil(clock[-1])) + 1), clock, ends)
        knots = np.linspace(0.0, last, STRETCHES + 2)
        offset = np.pad(self.offset, ((1, 1), (0, 0)))
        played = _interpolate(at, np.arange(last + 1.0), target)
        shift = _interpolate(at, knots, offset) @ pair_directions(robot)
        return robot.limit_targets(played + shift, start)


def pair_directions(robot: Robot) -> Array:
    """Return what each mirrored pair of joints that rises moves, (pairs, n)."""
    chosen = (*robot.rising_joints, *robot.spreading_joints)
    one = np.eye(robot.n)[[robot.joint_names.index(name) for name in chosen]]
    return one + robot.mirror_joints(one)


def _interpolate(at: Array, time: Array, rows: Array) -> Array:
    return np.stack([np.interp(at, time, column) for column in rows.T], axis=1)
