"""Crouches: balanced postures on flat soles, deep or high, the torso upright or bent forward."""

from __future__ import annotations

import numpy as np

from robots.body.both_legs import BothLegs, find_overlaps_but_arms
from robots.body.flat_soles import CLOSE, ROUGH, FlatSoles, Foot, fit_posture
from robots.body.limbs import Limbs
from robots.quaternion import Array

EXTENSIONS = (0.2, 0.98)  # shares of the stretched leg
LEANS = (-0.5, 1.0)  # sines of the torso's lean forward
STRIDES, WIDTHS = (-0.25, 0.25), (-0.05, 0.3)
"""Leg lengths by which feet are further apart than in the stance."""
STRIDING = 0.3  # probability that one foot is in front of the other
LEAN = 1.0  # weight of the wanted lean
SOLVED = 0.015  # largest residual, in leg lengths and unit vectors
MOST_SPREAD = 0.8  # of the arms' way from the stance to a random posture


def draw_crouches(limbs: Limbs, count: int, rng: np.random.Generator) -> Array:
    """Draw balanced crouches that do not overlap themselves, (C, n) [rad]; arms are anywhere."""
    sampler = _CrouchSampler(limbs)
    drawn = [sampler.draw(rng) for _ in range(count)]
    return np.array([each for each in drawn if each is not None]).reshape(-1, limbs.robot.n)


class _CrouchSampler:
    """Fits legs to random crouches."""

    def __init__(self, limbs: Limbs) -> None:
        self._limbs, self._robot, self._both = limbs, limbs.robot, BothLegs(limbs)
        self._usual = find_overlaps_but_arms(limbs, self._robot.standing.joint_pos)

    def draw(self, rng: np.random.Generator) -> Array | None:
        """Draw one crouch; None if the legs cannot take it, or it overlaps itself."""
        robot, both = self._robot, self._both
        anywhere = rng.uniform(robot.lower, robot.upper)
        home, share = robot.standing.joint_pos, rng.uniform(0.0, MOST_SPREAD)
        base = home + share * (robot.symmetrize(anywhere) - home)
        base[both.joints] = home[both.joints]
        stride = rng.uniform(*STRIDES) if rng.random() < STRIDING else 0.0
        wide = rng.uniform(*WIDTHS) * both.length
        feet = [
            Foot(foot.leg, foot.width + side * wide, foot.yaw)
            for foot, side in zip(both.feet, (0.5, -0.5), strict=True)
        ]
        soles = FlatSoles(
            view=self._limbs,
            feet=feet,
            length=both.length,
            stride=both.stride + stride * both.length,
        )
        angles = self._fit(soles, base, rng.uniform(*EXTENSIONS), rng.uniform(*LEANS))
        if angles is None or find_overlaps_but_arms(self._limbs, angles) - self._usual:
            return None
        return angles

    def _fit(self, soles: FlatSoles, base: Array, extension: float, lean: float) -> Array | None:
        reach, both = extension * soles.length, self._both

        def measure() -> Array:
            back, errors = soles.measure(reach)
            return np.concatenate([LEAN * (back + lean), CLOSE * errors])

        bent = both.bend_knees(base, 1.0)
        angles = fit_posture(
            lambda values: both.look(base, values),
            measure,
            bent,
            base[both.joints],
            both.bounds,
            ROUGH,
        )
        return angles if np.abs(soles.measure(reach)[1]).max() < SOLVED else None
