"""Squats: balanced postures on flat soles, from high to deep."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robots.body.flat_soles import CLOSE, BothLegs, FlatSoles, find_overlaps_but_arms, fit_posture
from robots.body.limbs import Limbs
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
    search = _SquatSearch(limbs)
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


def find_touching(limbs: Limbs, statics: Statics, squats: Sequence[Squat]) -> list[tuple[str, str]]:
    """Find the pairs of bodies that touch each other in the first deeper squat, by name."""
    search, model = _SquatSearch(limbs), limbs.model
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

    def __init__(self, limbs: Limbs) -> None:
        self._both, self._home = BothLegs(limbs), limbs.robot.standing.joint_pos
        self._before = self._home
        self._soles = FlatSoles(
            view=limbs, feet=self._both.feet, length=self._both.length, stride=self._both.stride
        )
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
