"""Postures balanced on flat soles: the residual of a posture, and the search for one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from robots.body.joint_view import JointView
from robots.body.limb import ARMS, LEGS, Leg
from robots.body.limbs import Limbs
from robots.body.links import list_way_up
from robots.body.overlap import find_overlaps
from robots.quaternion import Array

CLOSE, HABIT = 5.0, 0.02
"""Weights of the feet's place, and of the angles' distance from the start."""
EVALUATIONS, EXACT, ROUGH = 200, 1e-8, 1e-3
MARGIN = 0.02  # rad from the end of a joint's range


@dataclass(frozen=True, eq=False)
class Foot:
    """Where a sole should be, beside the hip of its leg."""

    leg: Leg
    width: float
    """To the left of the hip [m]."""
    yaw: float
    """Sine of the angle by which it points to the left."""

    @classmethod
    def stand(cls, leg: Leg) -> Foot:
        """Return where the view has the foot now."""
        return cls(leg, float(leg.sole_position[1] - leg.hip[1]), float(leg.sole_axes[1, 0]))


@dataclass(frozen=True, eq=False, kw_only=True)
class FlatSoles:
    """Soles that are parallel and side by side, the center of mass above them."""

    view: JointView
    feet: Sequence[Foot]
    """Of both legs, or of one whose mirror image the other is."""
    length: float
    """Of a stretched leg [m], by which distances are measured."""
    stride: float = 0.0
    """By which the first sole is in front of the second [m]."""
    width_weight: float = 1.0
    """Of a sole's place beside the hip."""

    def measure(self, reach: float) -> tuple[Array, Array]:
        """Measure how far the posture of the view is from standing on legs of a length.

        Args:
            reach: From the hip to the ground [m].

        Returns:
            Sines of the angles by which the torso leans back over each of f soles, (f,), and
            errors of unit vectors and of places in lengths of a leg.
        """
        legs = [foot.leg for foot in self.feet]
        axes = np.array([leg.sole_axes for leg in legs])  # (f, 3, 3)
        soles = np.array([leg.sole_position for leg in legs])  # (f, 3)
        errors = [(axes[:-1, :, 2] - axes[1:, :, 2]).ravel()]
        for foot, own, sole in zip(self.feet, axes, soles, strict=True):
            hip = foot.leg.hip
            width = self.width_weight * (sole[1] - hip[1] - foot.width) / self.length
            height = ((hip - sole) @ own[:, 2] - reach) / self.length
            errors.append(np.array([own[1, 2], own[1, 0] - foot.yaw, width, height]))
        stride = (soles[:-1, 0] - soles[1:, 0] - self.stride) / self.length
        over = self.view.center_of_mass - soles.mean(axis=0)
        balance = over @ axes[:, :, 0].mean(axis=0) / self.length
        return axes[:, 0, 2], np.concatenate([*errors, stride, [balance]])


def fit_posture(
    look: Callable[[Array], Array],
    measure: Callable[[], Array],
    start: Array,
    before: Array,
    bounds: tuple[Array, Array],
    tolerance: float = EXACT,
) -> Array:
    """Fit some joint angles (j,) within bounds [rad]; return all angles (n,), looked at last.

    Args:
        look: Looks at a posture with these angles, and returns all of its angles.
        measure: Measures the weighed errors of the posture that was looked at last.
        start: Angles from which the search begins, clipped.
        before: Angles from which the way should be short.
        bounds: Least and greatest angles.
        tolerance: Relative change below which it is good enough.
    """

    def residuals(values: Array) -> Array:
        look(values)
        return np.concatenate([measure(), HABIT * (values - before)])

    start = np.clip(start, *bounds)
    found = least_squares(
        residuals, start, bounds=bounds, max_nfev=EVALUATIONS, ftol=tolerance, xtol=tolerance
    )
    return look(found.x)


class BothLegs:
    """Both legs of a robot, which stand on flat soles."""

    def __init__(self, limbs: Limbs) -> None:
        """Measure the stance."""
        self.limbs, robot = limbs, limbs.robot
        self.joints = np.array([k for name in LEGS for k in limbs.all[name].joints])
        """Their joints, (j,)."""
        lower, upper = robot.lower[self.joints], robot.upper[self.joints]
        margin = np.minimum(MARGIN, 0.25 * (upper - lower))
        self.bounds = (lower + margin, upper - margin)
        """Least and greatest angles of these [rad], (j,) each."""
        limbs.look(robot.standing.joint_pos)
        self.legs = [limbs.leg(name) for name in LEGS]
        """As the limbs were looked at last."""
        self.feet = [Foot.stand(leg) for leg in self.legs]
        """Where the soles are in the stance."""
        self.length = self.legs[0].measure_stretched()
        """Of a stretched leg [m]."""
        left, right = (leg.sole_position[0] for leg in self.legs)
        self.stride = float(left - right)
        """By which the left sole is in front of the right one in the stance [m]."""

    def look(self, base: Array, values: Array) -> Array:
        """Look at angles (n,) with others of the legs (j,); return all, (n,)."""
        angles = base.copy()
        angles[self.joints] = values
        self.limbs.look(angles)
        return angles

    def bend_knees(self, base: Array, way: float) -> Array:
        """Bend the knees of angles (n,) forward, 1, or back, -1; return those of the legs, (j,)."""
        bent = base.copy()
        self.limbs.look(base)
        for leg in self.legs:
            leg.bend_knee(bent, way)
        return bent[self.joints]


def find_overlaps_but_arms(limbs: Limbs, joint_pos: Array) -> set[tuple[int, int]]:
    """Find bodies that penetrate each other, except arms, which can be moved away."""
    limbs.look(joint_pos)
    arms = {limbs.first_body(limbs.all[name]) for name in ARMS if name in limbs.all}
    return {
        pair
        for pair in find_overlaps(limbs.model, limbs.data.qpos)
        if not any(arms & {*list_way_up(limbs.model, body)} for body in pair)
    }
