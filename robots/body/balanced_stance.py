"""Stances: balanced on flat soles, torso upright, knees slightly bent, arms down."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from robots.body.body_plan import BodyPlan
from robots.body.flat_soles import CLOSE, MARGIN, FlatSoles, Foot, fit_posture
from robots.quaternion import Array

EXTENSION = 0.94  # of the longest leg
LOOSE = 0.3  # weight of the arms' direction
EASY = 0.2
"""Weight of the distance between the feet, which is small: legs without ankle roll have flat soles
at one width only."""
SPREADS = (0.1, 0.25, 0.4, 0.6, 0.8, 1.0)
"""Slopes at which arms hang outwards, tried in turn until they touch nothing."""
LONG_PART = 0.2  # share of an arm from which it has a direction of its own
SOLVED = 0.03  # largest residual of a stance, in leg lengths and unit vectors


@dataclass(frozen=True, eq=False)
class BalancedStance:
    """A posture in which a robot would stand."""

    joint_pos: Array
    """[rad], (n,)"""
    error: float
    """Largest residual: how far the soles are from flat and in place, in leg lengths."""

    @property
    def is_solved(self) -> bool:
        """Return whether both soles are flat, in place, and the robot is balanced on them."""
        return self.error < SOLVED


class StanceSolver:
    """Finds symmetric postures that stand on both soles."""

    def __init__(self, body: BodyPlan, before: Array) -> None:
        """Prepare to search from joint angles (n,), which must be within the limits."""
        self._body, self._view, self._leg = body, body.view, body.left_leg
        self._lower, self._upper = _narrow(body)
        self._before = np.clip(before, self._lower, self._upper)
        self._arms = [pair[0] for pair in body.arms]
        self._free = [*self._leg.joints, *(k for arm in self._arms for k in arm)]
        self._view.look(self._before)
        self._arm_parts = [self._list_arm_parts(arm) for arm in self._arms]
        self.leg_length = self._leg.measure_stretched()
        """From the hip to the sole, stretched [m]."""
        width = abs(self._leg.sole_position[1] - self._leg.hip[1])
        self._soles = FlatSoles(
            view=self._view,
            feet=[Foot(self._leg, float(width), 0.0)],
            length=self.leg_length,
            width_weight=EASY,
        )

    def solve(self, extension: float = EXTENSION, spread: float = SPREADS[0]) -> BalancedStance:
        """Find a stance with legs bent to a share of their length, arms sloping outwards."""
        tries = [self._solve_from(bend, extension, spread) for bend in self._list_bends()]
        solved = [stance for stance in tries if stance.is_solved]
        return max(solved, key=self._measure_knee) if solved else min(tries, key=lambda s: s.error)

    def _list_bends(self) -> list[Array]:
        """List start angles of the search: the given ones, and both ways of bending the knees."""
        bends = [self._before, self._before.copy(), self._before.copy()]
        for angles, way in zip(bends[1:], (1.0, -1.0), strict=True):
            self._leg.bend_knee(angles, way)
        return [bends[0], *map(self._mirrored, bends[1:])]

    def _solve_from(self, start: Array, extension: float, spread: float) -> BalancedStance:
        free, reach = self._free, extension * self.leg_length

        def measure() -> Array:
            errors = self._measure_errors(reach), self._arm_errors(spread)
            return np.concatenate([CLOSE * errors[0], LOOSE * errors[1]])

        bounds = (self._lower[free], self._upper[free])
        angles = fit_posture(self._look, measure, start[free], self._before[free], bounds)
        return BalancedStance(angles, float(np.abs(self._measure_errors(reach)).max()))

    def _measure_errors(self, reach: float) -> Array:
        return np.concatenate(self._soles.measure(reach))

    def _arm_errors(self, spread: float) -> Array:
        """Compute how far each part of the left arms is from hanging down and out, (3 p,)."""
        wanted = np.array([0.1, spread, -1.0]) / np.hypot(np.hypot(0.1, spread), 1.0)
        errors = []
        for arm, parts in zip(self._arms, self._arm_parts, strict=True):
            points = [*map(self._view.anchor, parts), self._view.end(arm[-1])]
            errors += [_unit(b - a) - wanted for a, b in pairwise(points)]
        return np.concatenate([np.zeros(0), *errors])

    def _list_arm_parts(self, arm: Sequence[int]) -> list[int]:
        """List the hinges of an arm at which a new part of it begins: shoulder, elbow, wrist."""
        anchor = self._view.anchor
        whole = float(np.linalg.norm(self._view.end(arm[-1]) - anchor(arm[0])))
        parts = [arm[0]]
        for k in arm[1:]:
            if np.linalg.norm(anchor(k) - anchor(parts[-1])) > LONG_PART * whole:
                parts.append(k)
        return parts

    def _look(self, values: Array) -> Array:
        """Pose the view at the free angles of both sides; return all angles (n,)."""
        angles = self._before.copy()
        angles[self._free] = values
        angles = self._mirrored(angles)
        self._view.look(angles)
        return angles

    def _mirrored(self, angles: Array) -> Array:
        """Give the right side the left one's angles."""
        mirror, out = self._body.mirror, angles.copy()
        for k in self._free:
            out[mirror.index[k]] = mirror.sign[k] * angles[k]
        return np.clip(out, self._body.lower, self._body.upper)

    def _measure_knee(self, stance: BalancedStance) -> float:
        self._view.look(stance.joint_pos)
        return self._leg.measure_knee_lead()


def _narrow(body: BodyPlan) -> tuple[Array, Array]:
    """Return joint limits [rad], (n,) each, that hold for both sides, and a margin from them."""
    index, sign = body.mirror.index, body.mirror.sign
    other = sign * np.stack([body.lower, body.upper])[:, index]  # (2, n): the mirror joints' limits
    lower, upper = np.maximum(body.lower, other.min(axis=0)), np.minimum(body.upper, other.max(0))
    apart = upper <= lower  # limits that exclude each other are those of a mistaken model
    lower, upper = np.where(apart, body.lower, lower), np.where(apart, body.upper, upper)
    margin = np.minimum(MARGIN, 0.45 * (upper - lower))
    return lower + margin, upper - margin


def _unit(vector: Array) -> Array:
    return vector / max(float(np.linalg.norm(vector)), 1e-9)
