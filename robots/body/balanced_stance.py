"""Stances: balanced on flat soles, the torso upright, the knees bent a little, the arms down."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import mujoco
import numpy as np
from scipy.optimize import least_squares

from robots.model_import.body import Body
from robots.quaternion import Array

EXTENSION = 0.94  # of the longest leg
BEND = 0.6  # rad by which knees are bent before the search
CLOSE, LOOSE, HABIT = 5.0, 0.3, 0.02
"""Weights: of the feet's place, of the arms' direction, of the angles' distance from before."""
EASY = 0.2  # weight of the feet's distance from each other
SPREADS = (0.1, 0.25, 0.4, 0.6, 0.8, 1.0)
"""Slopes at which arms hang outwards, tried in turn until they are free."""
LONG_PART = 0.2  # share of an arm from which it has a direction of its own
MARGIN = 0.02  # rad from the end of a joint's range
SOLVED = 0.03  # largest residual of a stance, in leg lengths and unit vectors
ROOT = 7  # positions of a free joint
EVALUATIONS = 200


@dataclass(frozen=True, eq=False)
class Stance:
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

    def __init__(self, body: Body, before: Array) -> None:
        """Prepare to search from joint angles (n,), which must be within the limits."""
        self._body, self._model = body, body.model
        self._data = mujoco.MjData(body.model)
        self._lower, self._upper = _narrow(body)
        self._before = np.clip(before, self._lower, self._upper)
        self._soles = [body.model.site(name).id for name in body.soles]
        self._left_leg, self._left_arms = list(body.legs[0]), [pair[0] for pair in body.arms]
        self._free = self._left_leg + [k for arm in self._left_arms for k in arm]
        self._look(self._before)
        self._arm_parts = [self._list_arm_parts(arm) for arm in self._left_arms]
        self._leg_width = float(abs(self._data.site_xpos[self._soles[0], 1] - self._hip()[1]))
        self._side = float(self._hip()[1])
        self.leg_length = self._measure_leg_length()
        """From the hip to the sole, stretched [m]."""

    def solve(self, extension: float = EXTENSION, spread: float = SPREADS[0]) -> Stance:
        """Find a stance with legs of that share of their length, arms sloping outwards."""
        tries = [self._solve_from(bend, extension, spread) for bend in self._list_bends()]
        solved = [stance for stance in tries if stance.is_solved]
        return max(solved, key=self._knee_lead) if solved else min(tries, key=lambda s: s.error)

    def _list_bends(self) -> list[Array]:
        """List angles to search from: as before, and both ways of bending the knees."""
        pitch = [k for k in self._left_leg if abs(self._axis(k)[1]) > 0.8]
        bends = [self._before]
        if len(pitch) >= 3:
            hip, knee, ankle = pitch[0], pitch[len(pitch) // 2], pitch[-1]
            for way in (1.0, -1.0):
                angles = self._before.copy()
                for k, share in ((hip, 1.0), (knee, -2.0), (ankle, 1.0)):
                    angles[k] += way * share * BEND / 2.0 * np.sign(self._axis(k)[1]) * -1.0
                bends.append(self._mirrored(angles))
        return bends

    def _solve_from(self, start: Array, extension: float, spread: float) -> Stance:
        free = self._free
        bounds = (self._lower[free], self._upper[free])
        reach = extension * self.leg_length

        def residuals(values: Array) -> Array:
            angles = self._before.copy()
            angles[free] = values
            self._look(self._mirrored(angles))
            habit = HABIT * (values - self._before[free])
            return np.concatenate(
                [CLOSE * self._foot_errors(reach), LOOSE * self._arm_errors(spread), habit]
            )

        start = np.clip(start[free], *bounds)
        found = least_squares(residuals, start, bounds=bounds, max_nfev=EVALUATIONS)
        angles = self._before.copy()
        angles[free] = found.x
        angles = self._mirrored(angles)
        self._look(angles)
        return Stance(angles, float(np.abs(self._foot_errors(reach)).max()))

    def _foot_errors(self, reach: float) -> Array:
        """Compute how far the left sole is from flat, straight, beneath hip and mass, (6,)."""
        data, sole = self._data, self._soles[0]
        axes = data.site_xmat[sole].reshape(3, 3)
        position = data.site_xpos[sole]
        balance = (data.subtree_com[1, 0] - position[0]) / self.leg_length
        # Legs without roll at the ankle have flat soles at one width alone, whatever is wished.
        width = EASY * (position[1] - self._side - self._leg_width) / self.leg_length
        length = (self._hip()[2] - position[2] - reach) / self.leg_length
        return np.array([axes[0, 2], axes[1, 2], axes[1, 0], balance, width, length])

    def _arm_errors(self, spread: float) -> Array:
        """Compute how far each part of the left arms is from hanging down and out, (3 p,)."""
        wanted = np.array([0.1, spread, -1.0]) / np.hypot(np.hypot(0.1, spread), 1.0)
        errors = []
        for arm, parts in zip(self._left_arms, self._arm_parts, strict=True):
            points = [*(self._data.xanchor[k + 1] for k in parts), self._end(arm)]
            errors += [_unit(b - a) - wanted for a, b in pairwise(points)]
        return np.concatenate([np.zeros(0), *errors])

    def _list_arm_parts(self, arm: Sequence[int]) -> list[int]:
        """List the hinges of an arm at which a new part of it begins: shoulder, elbow, wrist."""
        whole = float(np.linalg.norm(self._end(arm) - self._data.xanchor[arm[0] + 1]))
        parts = [arm[0]]
        for k in arm[1:]:
            way = self._data.xanchor[k + 1] - self._data.xanchor[parts[-1] + 1]
            if np.linalg.norm(way) > LONG_PART * whole:
                parts.append(k)
        return parts

    def _end(self, arm: Sequence[int]) -> Array:
        """Return twice the way from the last joint of a limb to the middle of what it moves."""
        anchor = self._data.xanchor[arm[-1] + 1]
        return 2.0 * self._data.subtree_com[self._model.jnt_bodyid[arm[-1] + 1]] - anchor

    def _look(self, angles: Array) -> None:
        self._data.qpos[:ROOT] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]
        self._data.qpos[ROOT:] = angles
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_comPos(self._model, self._data)

    def _mirrored(self, angles: Array) -> Array:
        """Give the right side the left one's angles."""
        mirror, out = self._body.mirror, angles.copy()
        for k in self._free:
            out[mirror.index[k]] = mirror.sign[k] * angles[k]
        return np.clip(out, self._body.lower, self._body.upper)

    def _hip(self) -> Array:
        return self._data.xanchor[self._left_leg[0] + 1]

    def _axis(self, hinge: int) -> Array:
        return self._data.xaxis[hinge + 1]

    def _knee_lead(self, stance: Stance) -> float:
        """Measure how far the knee is in front of the line from hip to ankle [m]."""
        self._look(stance.joint_pos)
        pitch = [k for k in self._left_leg if abs(self._axis(k)[1]) > 0.8]
        if len(pitch) < 3:
            return 0.0
        hip, knee, ankle = (self._data.xanchor[pitch[i] + 1] for i in (0, len(pitch) // 2, -1))
        share = (hip[2] - knee[2]) / max(hip[2] - ankle[2], 1e-6)
        return float(knee[0] - hip[0] - share * (ankle[0] - hip[0]))

    def _measure_leg_length(self) -> float:
        """Measure the way from the hip to the sole through the joints' anchors [m]."""
        points = [self._data.xanchor[k + 1] for k in self._left_leg if abs(self._axis(k)[1]) > 0.8]
        points = [self._hip(), *points, self._data.site_xpos[self._soles[0]]]
        flat = np.array(points)[:, [0, 2]]
        return float(np.linalg.norm(np.diff(flat, axis=0), axis=1).sum())


def _narrow(body: Body) -> tuple[Array, Array]:
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
