"""Balanced postures drawn at random: crouches on flat soles, and props on the hands as well."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robots.body.limb_solver import Trunk
from robots.body.limbs import ARMS, LEGS, Limbs
from robots.body.squats import (
    CLOSE,
    MARGIN,
    ROUGH,
    UP,
    BothLegs,
    FlatSoles,
    Foot,
    find_overlaps_but_arms,
    fit_posture,
)
from robots.quaternion import Array

CROUCH_EXTENSIONS = (0.2, 0.98)  # shares of the stretched leg
CROUCH_LEANS = (-0.5, 1.0)  # sines of the torso's lean forward
STRIDES, CROUCH_WIDTHS = (-0.25, 0.25), (-0.05, 0.3)
"""Leg lengths by which feet are further apart than in the stance."""
STRIDING = 0.3  # probability that one foot is in front of the other
CROUCH_LEAN = 1.0  # weight of the wanted lean
CROUCH_SOLVED = 0.015  # largest residual, in leg lengths and unit vectors
MOST_SPREAD = 0.8  # of the arms' way from the stance to a random posture


def draw_crouches(limbs: Limbs, count: int, rng: np.random.Generator, up: Array = UP) -> Array:
    """Draw balanced crouches that do not overlap themselves, (C, n) [rad]; arms are anywhere.

    The vertical is ``up`` in the frame of their soles.
    """
    sampler = _CrouchSampler(limbs, up)
    drawn = [sampler.draw(rng) for _ in range(count)]
    return np.array([each for each in drawn if each is not None]).reshape(-1, limbs.robot.n)


class _CrouchSampler:
    """Fits legs to random crouches."""

    def __init__(self, limbs: Limbs, up: Array) -> None:
        self._limbs, self._robot, self._both = limbs, limbs.robot, BothLegs(limbs)
        self._up = up
        self._usual = find_overlaps_but_arms(limbs, self._robot.standing.joint_pos)

    def draw(self, rng: np.random.Generator) -> Array | None:
        """Draw one crouch; None if the legs cannot take it, or it overlaps itself."""
        robot, both = self._robot, self._both
        anywhere = rng.uniform(robot.lower, robot.upper)
        home, share = robot.standing.joint_pos, rng.uniform(0.0, MOST_SPREAD)
        base = home + share * (robot.symmetrize(anywhere) - home)
        base[both.joints] = home[both.joints]
        stride = rng.uniform(*STRIDES) if rng.random() < STRIDING else 0.0
        wide = rng.uniform(*CROUCH_WIDTHS) * both.length
        feet = [
            Foot(foot.leg, foot.width + side * wide, foot.yaw)
            for foot, side in zip(both.feet, (0.5, -0.5), strict=True)
        ]
        soles = FlatSoles(
            view=self._limbs,
            feet=feet,
            length=both.length,
            stride=both.stride + stride * both.length,
            up=self._up,
        )
        angles = self._fit(soles, base, rng.uniform(*CROUCH_EXTENSIONS), rng.uniform(*CROUCH_LEANS))
        if angles is None or find_overlaps_but_arms(self._limbs, angles) - self._usual:
            return None
        return angles

    def _fit(self, soles: FlatSoles, base: Array, extension: float, lean: float) -> Array | None:
        reach, both = extension * soles.length, self._both

        def measure() -> Array:
            back, errors = soles.measure(reach)
            return np.concatenate([CROUCH_LEAN * (back + lean), CLOSE * errors])

        bent = both.bend_knees(base, 1.0)
        angles = fit_posture(
            lambda values: both.look(base, values),
            measure,
            bent,
            base[both.joints],
            both.bounds,
            ROUGH,
        )
        return angles if np.abs(soles.measure(reach)[1]).max() < CROUCH_SOLVED else None


EXTENSIONS = (0.15, 0.98)  # shares of the stretched leg
LEANS = (-1.2, 1.8)  # rad by which the torso leans forward
MOST_DOWN = 0.4  # of the unit vector to the head, that points down at most
MOST_SHARE = 0.5  # of the weight that hands carry; small shares are drawn more often
WIDTHS = (-0.05, 0.3)  # leg lengths by which feet are further apart than in the stance
NEAREST = 0.1  # leg lengths of hands from the middle of the soles
REACH, LEAN = 0.3, 0.3  # weights of the wanted extension and lean
SOLVED = 0.03  # largest residual, in leg lengths and unit vectors
HEIGHT, BALANCE = 3, 4
"""Where `FlatSoles.measure` has the errors of the hip's height and of the balance on one sole."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Prop:
    """A posture on flat soles, and on hands if there are any."""

    joint_pos: Array
    """(n,) [rad]"""
    share: float = 0.0
    """Of the weight that the hands carry."""
    hands: tuple[tuple[int, Array], ...] = ()
    """Body of each hand, and where in its frame it touches the ground [m], (3,)."""


def draw_props(limbs: Limbs, count: int, rng: np.random.Generator, up: Array = UP) -> list[Prop]:
    """Draw up to a number of props that do not overlap themselves; none without two arms."""
    if any(name not in limbs.all for name in ARMS):
        return []
    sampler = _PropSampler(limbs, up)
    drawn = [sampler.draw(rng) for _ in range(count)]
    return [each for each in drawn if each is not None]


class _PropSampler:
    """Fits arms and legs to random props."""

    def __init__(self, limbs: Limbs, up: Array) -> None:
        self._limbs, self._robot, self._both = limbs, limbs.robot, BothLegs(limbs)
        self._up = up
        robot, arm, leg = limbs.robot, limbs.all[ARMS[0]], limbs.all[LEGS[0]]
        self._arm, self._legs = arm, len(leg.joints)
        own, sign = robot.mirror_index, robot.mirror_sign
        spine = [k for k in Trunk(robot).joints if own[k] == k and sign[k] > 0.0]  # that pitch
        self._joints = np.array([*leg.joints, *arm.joints, *spine])
        self._partners = robot.mirror_index[self._joints]
        lower, upper = robot.lower[self._joints], robot.upper[self._joints]
        margin = np.minimum(MARGIN, 0.25 * (upper - lower))
        self._bounds = (lower + margin, upper - margin)
        self._usual = find_overlaps_but_arms(limbs, robot.standing.joint_pos)

    def draw(self, rng: np.random.Generator) -> Prop | None:
        """Draw one prop; None if the limbs cannot take it, or it overlaps itself."""
        both, home = self._both, self._robot.standing.joint_pos
        foot, wide = both.feet[0], 0.5 * rng.uniform(*WIDTHS) * both.length
        soles = FlatSoles(
            view=self._limbs,
            feet=[Foot(foot.leg, foot.width + wide, foot.yaw)],
            length=both.length,
            up=self._up,
        )
        reach = rng.uniform(*EXTENSIONS) * both.length
        lean, share = rng.uniform(*LEANS), MOST_SHARE * rng.random() ** 2
        up = np.array([-np.sin(lean), 0.0, np.cos(lean)])
        start = rng.uniform(*self._bounds)
        start[: self._legs] = home[self._joints[: self._legs]]

        def measure() -> Array:
            errors, leans = soles.measure(reach)[1], LEAN * (foot.leg.sole_axes[:, 2] - up)
            must = CLOSE * self._measure_errors(soles, errors, share)
            return np.concatenate([leans, [REACH * errors[HEIGHT]], must])

        angles = fit_posture(self._look, measure, start, start, self._bounds, ROUGH)
        errors = self._measure_errors(soles, soles.measure(reach)[1], share)
        if foot.leg.sole_axes[2, 2] < -MOST_DOWN or np.abs(errors).max() > SOLVED:
            return None
        # The right limbs must be able to take what the left ones do.
        is_in_range = np.all((angles >= self._robot.lower) & (angles <= self._robot.upper))
        if abs(self._measure_hand(soles)[0]) < NEAREST or not is_in_range:
            return None
        if find_overlaps_but_arms(self._limbs, angles) - self._usual:
            return None
        self._limbs.look(angles)
        return Prop(joint_pos=angles, share=share, hands=self._locate_hands())

    def _look(self, values: Array) -> Array:
        """Look at the stance with other angles of the left limbs, mirrored; return all, (n,)."""
        angles = self._robot.standing.joint_pos.copy()
        angles[self._joints] = values
        angles[self._partners] = self._robot.mirror_joints(angles)[self._partners]
        self._limbs.look(angles)
        return angles

    def _measure_errors(self, soles: FlatSoles, errors: Array, share: float) -> Array:
        """Measure how far the sole is from flat, the hand from the ground, the weight from both."""
        ahead, height = self._measure_hand(soles)
        balance = errors[BALANCE] - share * ahead
        return np.array([*errors[:HEIGHT], height, balance])

    def _measure_hand(self, soles: FlatSoles) -> tuple[float, float]:
        """Measure how far the hand is in front of the sole, and over it, in leg lengths."""
        leg = soles.feet[0].leg
        way = (self._limbs.find_end(self._arm) - leg.sole_position) / soles.length
        axes = leg.sole_axes
        return float(way @ axes[:, 0]), float(way @ axes[:, 2])

    def _locate_hands(self) -> tuple[tuple[int, Array], ...]:
        limbs, hands = self._limbs, list[tuple[int, Array]]()
        for name in ARMS:
            limb = limbs.all[name]
            body = int(limbs.model.jnt_bodyid[limbs.ids[limb.joints[-1]]])
            turn = limbs.data.xmat[body].reshape(3, 3)
            hands.append((body, turn.T @ (limbs.find_end(limb) - limbs.data.xpos[body])))
        return tuple(hands)
