"""Crouches: balanced postures on flat soles, deep or high, the torso upright or bent forward."""

from __future__ import annotations

import numpy as np
from scipy.optimize import least_squares

from robots.body.flat_soles import CLOSE, HABIT, MARGIN, FlatSoles, Foot
from robots.body.limb import ARMS, LEGS
from robots.body.limbs import Limbs
from robots.body.links import list_way_up
from robots.body.overlap import find_overlaps
from robots.quaternion import Array

EXTENSIONS = (0.2, 0.98)  # shares of the stretched leg
LEANS = (-0.2, 1.0)  # sines of the torso's lean forward
STRIDES, WIDTHS = (
    (-0.25, 0.25),
    (-0.05, 0.3),
)  # leg lengths by which feet are apart beyond the stance
STRIDING = 0.3  # probability that one foot is in front of the other
LEAN = 1.0  # weight of the wanted lean
SOLVED = 0.03  # largest residual, in leg lengths and unit vectors
EVALUATIONS = 60


def draw_crouches(limbs: Limbs, count: int, rng: np.random.Generator) -> Array:
    """Draw balanced crouches that do not overlap themselves, (C, n) [rad]; arms are anywhere."""
    sampler = _CrouchSampler(limbs)
    drawn = [sampler.draw(rng) for _ in range(count)]
    return np.array([each for each in drawn if each is not None]).reshape(-1, limbs.robot.n)


class _CrouchSampler:
    """Fits legs to random crouches."""

    def __init__(self, limbs: Limbs) -> None:
        self._limbs, self._robot = limbs, limbs.robot
        self._legs = np.array([k for name in LEGS for k in limbs.all[name].joints])
        lower, upper = self._robot.lower[self._legs], self._robot.upper[self._legs]
        margin = np.minimum(MARGIN, 0.25 * (upper - lower))
        self._bounds = (lower + margin, upper - margin)
        limbs.look(self._robot.standing.joint_pos)
        legs = [limbs.leg(name) for name in LEGS]
        self._feet = [Foot.stand(leg) for leg in legs]
        self._length = legs[0].measure_stretched()
        self._stride = float(legs[0].sole_position[0] - legs[1].sole_position[0])
        self._arms = {limbs.first_body(limbs.all[name]) for name in ARMS if name in limbs.all}
        self._usual = self._find_overlaps(self._robot.standing.joint_pos)

    def draw(self, rng: np.random.Generator) -> Array | None:
        """Draw one crouch; None if the legs cannot take it, or it overlaps itself."""
        robot = self._robot
        anywhere = rng.uniform(robot.lower, robot.upper)
        share = rng.uniform(0.0, 0.8)
        home = robot.standing.joint_pos
        base = home + share * (0.5 * (anywhere + robot.mirror_joints(anywhere)) - home)
        base[self._legs] = home[self._legs]
        stride = rng.uniform(*STRIDES) * self._length if rng.random() < STRIDING else 0.0
        wide = rng.uniform(*WIDTHS) * self._length
        feet = [
            Foot(foot.leg, foot.width + side * wide, foot.yaw)
            for foot, side in zip(self._feet, (0.5, -0.5), strict=True)
        ]
        soles = FlatSoles(
            view=self._limbs, feet=feet, length=self._length, stride=self._stride + stride
        )
        angles = self._fit(soles, base, rng.uniform(*EXTENSIONS), rng.uniform(*LEANS))
        if angles is None or self._find_overlaps(angles) - self._usual:
            return None
        return angles

    def _fit(self, soles: FlatSoles, base: Array, extension: float, lean: float) -> Array | None:
        reach, angles = extension * self._length, base.copy()

        def measure(values: Array) -> Array:
            angles[self._legs] = values
            self._limbs.look(angles)
            leans, errors = soles.measure(reach)
            return np.concatenate(
                [LEAN * (leans - lean), CLOSE * errors, HABIT * (values - base[self._legs])]
            )

        start = np.clip(self._bend(base), *self._bounds)
        found = least_squares(measure, start, bounds=self._bounds, max_nfev=EVALUATIONS).x
        measure(found)
        return angles if np.abs(soles.measure(reach)[1]).max() < SOLVED else None

    def _bend(self, base: Array) -> Array:
        """Bend both knees; return the angles of the legs, (j,)."""
        bent = base.copy()
        self._limbs.look(base)
        for name in LEGS:
            self._limbs.leg(name).bend_knee(bent, 1.0)
        return bent[self._legs]

    def _find_overlaps(self, joint_pos: Array) -> set[tuple[int, int]]:
        """Find bodies that penetrate each other, except arms, which can be moved away."""
        self._limbs.look(joint_pos)
        model = self._limbs.model
        return {
            pair
            for pair in find_overlaps(model, self._limbs.data.qpos)
            if not any(self._arms & {*list_way_up(model, body)} for body in pair)
        }
