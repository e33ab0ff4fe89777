"""Squats: balanced postures on flat soles, from high to deep."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robots.body.flat_soles import CLOSE, MARGIN, FlatSoles, Foot, fit_posture
from robots.body.limb import ARMS, LEGS
from robots.body.limbs import Limbs
from robots.body.links import list_way_up
from robots.body.overlap import find_overlaps
from robots.body.statics import Statics
from robots.quaternion import Array

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
    """Find bodies that penetrate each other, except arms, which can be moved away."""
    limbs.look(joint_pos)
    arms = {limbs.first_body(limbs.all[name]) for name in ARMS if name in limbs.all}
    return {
        pair
        for pair in find_overlaps(limbs.model, limbs.data.qpos)
        if not any(arms & {*list_way_up(limbs.model, body)} for body in pair)
    }


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
        self._legs = [limbs.leg(name) for name in LEGS]
        left, right = (leg.sole_position[0] for leg in self._legs)
        self._soles = FlatSoles(
            view=limbs,
            feet=[Foot.stand(leg) for leg in self._legs],
            length=self._legs[0].measure_stretched(),
            stride=float(left - right),
        )
        self._bends = self._list_bends()

    def solve(self, extension: float) -> Array | None:
        """Find joint angles (n,) with legs bent to a share of their length; None if there are none.

        The search starts from the squat before, and also from bent knees.
        """
        reach = extension * self._soles.length
        for start in (self._before[self._joints], *self._bends):
            angles = self._solve_from(start, reach)
            if angles is not None:
                self._before = angles
                return angles
        return None

    def _solve_from(self, start: Array, reach: float) -> Array | None:
        def measure() -> Array:
            lean, errors = self._soles.measure(reach)
            return np.concatenate([LEAN * lean, CLOSE * errors])

        before = self._before[self._joints]
        angles = fit_posture(self._look, measure, start, before, self._bounds)
        return angles if np.abs(self._soles.measure(reach)[1]).max() < SOLVED else None

    def _look(self, values: Array) -> Array:
        angles = self._robot.standing.joint_pos.copy()
        angles[self._joints] = values
        self._limbs.look(angles)
        return angles

    def _list_bends(self) -> list[Array]:
        """List start angles (j,) of the search: knees bent forward, then knees bent back."""
        bends = [self._bend(way) for way in (1.0, -1.0)]
        return sorted(bends, key=self._measure_knee, reverse=True)

    def _bend(self, way: float) -> Array:
        angles = self._robot.standing.joint_pos.copy()
        self._limbs.look(angles)
        for leg in self._legs:
            leg.bend_knee(angles, way)
        return angles[self._joints]

    def _measure_knee(self, values: Array) -> float:
        self._look(np.clip(values, *self._bounds))
        return self._legs[0].measure_knee_lead()
