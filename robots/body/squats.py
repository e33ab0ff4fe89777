"""Postures balanced on flat soles: the search for one, and squats from high to deep."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
import scipy  # which imports its parts when they are used

from robots.body.joint_view import JointView
from robots.body.limbs import ARMS, LEGS, Leg, Limbs
from robots.body.overlap import find_overlaps
from robots.body.parts import list_way_up
from robots.body.statics import Statics
from robots.quaternion import Array

UP = np.array([0.0, 0.0, 1.0])
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
    up: Array = field(default_factory=lambda: UP)
    """The vertical in the frame of the soles, forward or back of their normal, (3,)."""

    def measure(self, reach: float) -> tuple[Array, Array]:
        """Measure how far the posture of the view is from standing on legs of a length.

        Args:
            reach: From the hip to the ground [m].

        Returns:
            Sines of the angles by which the torso leans back as seen by each of f soles, (f,), and
            errors of unit vectors and of places in lengths of a leg.
        """
        legs = [foot.leg for foot in self.feet]
        axes = np.array([leg.sole_axes for leg in legs])  # (f, 3, 3)
        soles = np.array([leg.sole_position for leg in legs])  # (f, 3)
        errors = [(axes[:-1, :, 2] - axes[1:, :, 2]).ravel()]
        for foot, own, sole in zip(self.feet, axes, soles, strict=True):
            hip = foot.leg.hip
            width = self.width_weight * (sole[1] - hip[1] - foot.width) / self.length
            height = ((hip - sole) @ (own @ self.up) - reach) / self.length
            errors.append(np.array([own[1, 2], own[1, 0] - foot.yaw, width, height]))
        stride = (soles[:-1, 0] - soles[1:, 0] - self.stride) / self.length
        over = self.view.center_of_mass - soles.mean(axis=0)
        ahead = axes[:, :, 0] - self.up[0] / self.up[2] * axes[:, :, 2]
        balance = over @ ahead.mean(axis=0) / self.length
        return (axes @ self.up)[:, 0], np.concatenate([*errors, stride, [balance]])


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
    found = scipy.optimize.least_squares(
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


EXTENSIONS = np.arange(0.95, 0.24, -0.05)
"""Leg lengths of the squats that are tried in turn, as shares of the stretched leg."""
DEEP_ENOUGH = 0.75  # share of standing neck height to which rises of OP3 crouch at least
LEAN = 0.2  # weight of a torso that may lean
SOLVED = 0.02  # largest residual, in leg lengths and unit vectors
MOST_LEAN = np.radians(50.0)  # of the torso; beyond, a robot folds rather than crouches
GAP = 3  # extensions in a row without a balanced posture: deeper ones are another way to crouch


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
    """List balanced squats without self-overlap, from high to deep.

    Bodies that overlap in the stance may overlap in squats.
    """
    search = _SquatSearch(limbs, statics.up)
    usual = find_overlaps_but_arms(limbs, limbs.robot.standing.joint_pos)
    squats: list[Squat] = []
    missed = 0
    for extension in EXTENSIONS:
        angles = search.solve(float(extension))
        if (
            angles is None
            or statics.measure_lean(angles) > MOST_LEAN
            or find_overlaps_but_arms(limbs, angles) - usual
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


def fit_stance(limbs: Limbs, up: Array) -> Array | None:
    """Fit the stance to soles in whose frame the vertical is ``up``; None if legs cannot, (n,)."""
    search = _SquatSearch(limbs, up)
    return search.solve(search.standing)


def find_touching(limbs: Limbs, statics: Statics, squats: Sequence[Squat]) -> list[tuple[str, str]]:
    """Find the pairs of bodies that touch each other in the first deeper squat, by name."""
    search, model = _SquatSearch(limbs, statics.up), limbs.model
    usual = find_overlaps_but_arms(limbs, limbs.robot.standing.joint_pos)
    deepest = min(squat.neck_share for squat in squats)
    for extension in EXTENSIONS:
        angles = search.solve(float(extension))
        if angles is not None and statics.measure_neck(angles) < deepest:
            touching = sorted(find_overlaps_but_arms(limbs, angles) - usual)
            return [(model.body(a).name, model.body(b).name) for a, b in touching]
    return []


class _SquatSearch:
    """Bends both legs of a robot, each within its own ranges."""

    def __init__(self, limbs: Limbs, up: Array) -> None:
        self._both, self._home = BothLegs(limbs), limbs.robot.standing.joint_pos
        self._before = self._home
        self._soles = FlatSoles(
            view=limbs,
            feet=self._both.feet,
            length=self._both.length,
            stride=self._both.stride,
            up=up,
        )
        leg = self._both.legs[0]
        reach = float((leg.hip - leg.sole_position) @ leg.sole_axes[:, 2])
        self.standing = reach / self._both.length
        """Length of the legs in the stance, as a share of the stretched leg."""
        bends = [self._both.bend_knees(self._home, way) for way in (1.0, -1.0)]
        self._bends = sorted(bends, key=self._measure_knee, reverse=True)

    def solve(self, extension: float) -> Array | None:
        """Find joint angles (n,) with legs bent to a share of their length; None if there are none.

        The search starts from the squat before, and also from bent knees.
        """
        reach = extension * self._soles.length
        for start in (self._before[self._both.joints], *self._bends):
            angles = self._solve_from(start, reach)
            if angles is not None:
                self._before = angles
                return angles
        return None

    def _solve_from(self, start: Array, reach: float) -> Array | None:
        def measure() -> Array:
            lean, errors = self._soles.measure(reach)
            return np.concatenate([LEAN * lean, CLOSE * errors])

        before = self._before[self._both.joints]
        angles = fit_posture(self._look, measure, start, before, self._both.bounds)
        return angles if np.abs(self._soles.measure(reach)[1]).max() < SOLVED else None

    def _look(self, values: Array) -> Array:
        return self._both.look(self._home, values)

    def _measure_knee(self, values: Array) -> float:
        self._look(np.clip(values, *self._both.bounds))
        return self._both.legs[0].measure_knee_lead()
