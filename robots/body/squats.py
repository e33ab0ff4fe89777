"""Squats: balanced postures on flat soles, from high to deep."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from robots.body.limb import ARMS, LEGS, Limb
from robots.body.limb_finder import TWIST
from robots.body.limbs import Limbs
from robots.body.statics import Statics
from robots.model_import.contacts import ROOT, find_overlaps
from robots.quaternion import Array

EXTENSIONS = np.arange(0.95, 0.24, -0.05)
"""Shares of the stretched leg to which a robot is asked to crouch, in turn."""
DEEP_ENOUGH = 0.75  # share of standing neck height to which rises of OP3 crouch at least
CLOSE, LEAN, HABIT = 5.0, 0.2, 0.02
"""Weights: of the feet's place, of a torso that may lean, of the angles' distance from before."""
BEND = 0.6  # rad by which knees are bent before a search
MARGIN = 0.02  # rad from the end of a joint's range
SOLVED = 0.02  # largest residual, in leg lengths and unit vectors
MOST_LEAN = np.radians(50.0)  # of the torso; beyond, a robot folds rather than crouches
GAP = 3  # extensions in a row without a balanced posture: deeper ones are another way to crouch
EVALUATIONS = 100


@dataclass(frozen=True, kw_only=True, eq=False)
class Squat:
    """A balanced posture on flat soles."""

    joint_pos: Array
    """[rad], (n,)"""
    neck_share: float
    """Height of the neck over that of the stance."""
    torque: Array
    """Torques that hold it [N·m], (n,), with their signs."""


def list_squats(limbs: Limbs, statics: Statics) -> list[Squat]:
    """List balanced squats from high to deep, in which no limb is in another one.

    What overlaps in the stance may overlap in squats.
    """
    search, usual = _SquatSearch(limbs), _find_overlaps(limbs, limbs.robot.standing.joint_pos)
    squats: list[Squat] = []
    missed = 0
    for extension in EXTENSIONS:
        angles = search.solve(float(extension))
        if (
            angles is None
            or statics.measure_lean(angles) > MOST_LEAN
            or _find_overlaps(limbs, angles) - usual
        ):
            missed += bool(squats)
            if missed >= GAP:
                break
            continue
        missed = 0
        squats.append(
            Squat(
                joint_pos=angles,
                neck_share=statics.measure_neck(angles),
                torque=statics.measure_torques(angles),
            )
        )
    return squats


def _find_overlaps(limbs: Limbs, joint_pos: Array) -> set[tuple[int, int]]:
    """Find bodies that reach into each other, but for arms, which can be moved away."""
    limbs.look(joint_pos)
    arms = {limbs.first_body(limbs.all[name]) for name in ARMS if name in limbs.all}
    return {
        pair
        for pair in find_overlaps(limbs.model, limbs.data.qpos[ROOT:])
        if not any(_is_below(limbs, body, arms) for body in pair)
    }


def _is_below(limbs: Limbs, body: int, tops: set[int]) -> bool:
    while body > 0 and body not in tops:
        body = int(limbs.model.body_parentid[body])
    return body in tops


@dataclass(frozen=True, eq=False)
class _Foot:
    """Where a foot is in the stance, beside its hip."""

    leg: Limb
    hip: int
    width: float
    """To the left of the hip [m]."""
    yaw: float
    """Sine of the angle by which it points to the left."""


class _SquatSearch:
    """Bends both legs of a robot, each within its own ranges."""

    def __init__(self, limbs: Limbs) -> None:
        self._limbs, self._robot = limbs, limbs.robot
        self._joints = [k for name in LEGS for k in limbs.all[name].joints]
        lower, upper = self._robot.lower[self._joints], self._robot.upper[self._joints]
        margin = np.minimum(MARGIN, 0.25 * (upper - lower))
        self._bounds = (lower + margin, upper - margin)
        self._before = self._robot.standing.joint_pos
        limbs.look(self._before)
        self._feet = [self._describe(limbs.all[name]) for name in LEGS]
        left, right = (limbs.sole_position(foot.leg)[0] for foot in self._feet)
        self._stride = float(left - right)  # by which the left sole is in front [m]
        self._length = self._measure_length()
        self._bends = self._list_bends()

    def solve(self, extension: float) -> Array | None:
        """Find joint angles (n,) with legs of that share of their length; None if there are none.

        The search goes on from the squat before, and also begins with knees that are bent.
        """
        reach = extension * self._length
        for start in (self._before[self._joints], *self._bends):
            angles = self._solve_from(start, reach)
            if angles is not None:
                self._before = angles
                return angles
        return None

    def _describe(self, leg: Limb) -> _Foot:
        hip, axes = leg.joints[0], self._limbs.sole_axes(leg)
        width = self._limbs.sole_position(leg)[1] - self._limbs.anchor(hip)[1]
        return _Foot(leg, hip, float(width), float(axes[1, 0]))

    def _solve_from(self, start: Array, reach: float) -> Array | None:
        before = self._before[self._joints]

        def residuals(values: Array) -> Array:
            self._look(values)
            lean, errors = self._measure_errors(reach)
            return np.concatenate([LEAN * lean, CLOSE * errors, HABIT * (values - before)])

        start = np.clip(start, *self._bounds)
        found = least_squares(residuals, start, bounds=self._bounds, max_nfev=EVALUATIONS)
        angles = self._look(found.x)
        return angles if np.abs(self._measure_errors(reach)[1]).max() < SOLVED else None

    def _look(self, values: Array) -> Array:
        angles = self._robot.standing.joint_pos.copy()
        angles[self._joints] = values
        self._limbs.look(angles)
        return angles

    def _measure_errors(self, reach: float) -> tuple[Array, Array]:
        """Measure how the torso leans, and how far the soles are from parallel, flat and in place.

        Returns:
            Sines of the angles between the torso and each sole, about y, (2,), and errors of unit
            vectors and of places in leg lengths, (13,).
        """
        limbs = self._limbs
        axes = np.array([limbs.sole_axes(foot.leg) for foot in self._feet])
        errors = [axes[0, :, 2] - axes[1, :, 2]]
        for foot, own in zip(self._feet, axes, strict=True):
            sole, hip = limbs.sole_position(foot.leg), limbs.anchor(foot.hip)
            width = (sole[1] - hip[1] - foot.width) / self._length
            height = ((hip - sole) @ own[:, 2] - reach) / self._length
            errors.append(np.array([own[1, 2], own[1, 0] - foot.yaw, width, height]))
        left, right = (limbs.sole_position(foot.leg) for foot in self._feet)
        stride = ((left - right)[0] - self._stride) / self._length
        balance = limbs.over_soles()[0] * limbs.leg_length / self._length
        return axes[:, 0, 2], np.concatenate([*errors, [stride, balance]])

    def _list_pitch_joints(self, leg: Limb) -> list[int]:
        return [k for k in leg.joints if abs(self._limbs.axis(k)[1]) > TWIST]

    def _measure_length(self) -> float:
        """Measure the way from the hip to the sole through the joints that bend the leg [m]."""
        leg = self._feet[0].leg
        points = [self._limbs.anchor(k) for k in self._list_pitch_joints(leg)]
        points = [self._limbs.anchor(leg.joints[0]), *points, self._limbs.sole_position(leg)]
        flat = np.array(points)[:, [0, 2]]
        return float(np.linalg.norm(np.diff(flat, axis=0), axis=1).sum())

    def _list_bends(self) -> list[Array]:
        """List angles (j,) to search from: knees bent forward, then knees bent back."""
        bends = [self._bend(way) for way in (1.0, -1.0)]
        return sorted(bends, key=self._measure_knee, reverse=True)

    def _bend(self, way: float) -> Array:
        angles = self._robot.standing.joint_pos.copy()
        self._limbs.look(angles)
        for foot in self._feet:
            pitch = self._list_pitch_joints(foot.leg)
            if foot.leg.middle in pitch:
                for k in pitch:
                    share = -1.0 if k == foot.leg.middle else 0.5
                    angles[k] += way * BEND * share * np.sign(self._limbs.axis(k)[1])
        return angles[self._joints]

    def _measure_knee(self, values: Array) -> float:
        """Measure how far the knee is in front of the hip [m]."""
        self._look(np.clip(values, *self._bounds))
        leg = self._feet[0].leg
        return float(self._limbs.anchor(leg.middle)[0] - self._limbs.anchor(leg.start)[0])
