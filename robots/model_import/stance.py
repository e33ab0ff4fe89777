"""The stance of an imported robot: balanced on flat soles, high, its arms clear of its body."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import mujoco
import numpy as np

from robots.body.joint_view import JointView
from robots.body.limbs import unit
from robots.body.overlap import Pair, find_overlaps
from robots.body.parts import list_way_up
from robots.body.squats import CLOSE, MARGIN, FlatSoles, Foot, fit_posture
from robots.model_import.body_plan import BodyPlan
from robots.quaternion import Array

POSES = 60
ALWAYS = 0.5  # share of random poses from which on a pair is said to overlap always
NEAR = 3  # hinges between bodies up to which shapes that overlap are brackets of each other
COMPACT = 0.1  # of the robot's extent by which such hinges may be apart, as those of a hip are


def find_own_overlaps(view: JointView, joint_pos: Array) -> dict[Pair, float]:
    """Find bodies that penetrate each other, and how deep [m], at joint angles (n,)."""
    view.look(joint_pos)
    return find_overlaps(view.model, view.data.qpos.copy())


def find_brackets(view: JointView, stance: Array, rng: np.random.Generator) -> list[Pair]:
    """Find pairs of bodies whose shapes overlap by construction.

    They overlap in most of random poses; or, with only a few hinges in one place between them, with
    all joints at zero or in the stance. A forearm that touches the torso is none.
    """
    count: dict[Pair, int] = {}
    lower, upper = view.model.jnt_range[view.ids].T
    for _ in range(POSES):
        pose = stance + 0.5 * rng.uniform(-1.0, 1.0, len(stance)) * (upper - lower) / 2.0
        for pair in find_own_overlaps(view, np.clip(pose, lower, upper)):
            count[pair] = count.get(pair, 0) + 1
    always = {pair for pair, times in count.items() if times >= ALWAYS * POSES}
    for pose in (np.clip(np.zeros(len(stance)), lower, upper), stance):
        found = find_own_overlaps(view, pose)
        always |= {pair for pair in found if _is_joined(view.model, *pair)}
    return sorted(always)


def exclude_brackets(spec: mujoco.MjSpec, view: JointView, stance: Array) -> str:
    """Switch off the contacts that `find_brackets` finds; return their names, or ""."""
    model = view.model
    pairs = [
        (model.body(first).name, model.body(second).name)
        for first, second in find_brackets(view, stance, np.random.default_rng(0))
    ]
    for first, second in pairs:
        spec.add_exclude(bodyname1=first, bodyname2=second)
    return ", ".join(f"{first} with {second}" for first, second in pairs)


def _is_joined(model: mujoco.MjModel, first: int, second: int) -> bool:
    """Tell whether only a few hinges at one place join two bodies."""
    moved = {*list_way_up(model, first)} ^ {*list_way_up(model, second)}
    hinges = np.flatnonzero(np.isin(model.jnt_bodyid, [*moved])).tolist()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    size = np.ptp(data.xanchor[hinges], axis=0)
    return len(hinges) <= NEAR and bool(np.linalg.norm(size) < COMPACT * model.stat.extent)


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
        bends = [self._before, self._before.copy(), self._before.copy()]  # the knees both ways
        for angles, way in zip(bends[1:], (1.0, -1.0), strict=True):
            self._leg.bend_knee(angles, way)
        starts = [bends[0], *map(self._mirrored, bends[1:])]
        tries = [self._solve_from(start, extension, spread) for start in starts]
        solved = [stance for stance in tries if stance.is_solved]
        return max(solved, key=self._measure_knee) if solved else min(tries, key=lambda s: s.error)

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
            errors += [unit(b - a) - wanted for a, b in pairwise(points)]
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


EXTENSIONS = (0.94, 0.9, 0.86, 0.82, 0.78, 0.7)
"""Shares of the stretched leg that are tried for the stance, in turn."""


def find_stance(body: BodyPlan, before: Array, notes: list[str]) -> BalancedStance:
    """Find a balanced stance on flat soles, or what comes closest; a note says so then.

    The search begins from joint angles (n,) [rad].
    """
    solver, best = StanceSolver(body, before), None
    for extension in EXTENSIONS:
        stance = solver.solve(extension)
        best = stance if best is None or stance.error < best.error else best
        if stance.is_solved:
            return _free_arms(body, solver, stance, extension)
    assert best is not None  # there is at least one extension
    notes.append(
        f"no balanced stance on flat soles was found (off by {best.error:.2f} leg lengths): "
        "write [standing] by hand, then getup robots check"
    )
    return best


def _free_arms(
    body: BodyPlan, solver: StanceSolver, stance: BalancedStance, extension: float
) -> BalancedStance:
    """Spread the arms until they touch only what they touch in any posture."""
    always = {*find_brackets(body.view, stance.joint_pos, np.random.default_rng(0))}
    moved = [body.view.ids[k] for pair in body.arms for limb in pair for k in limb[1:]]
    arms = set(body.model.jnt_bodyid[moved].tolist())  # but for those of their first hinges
    for spread in SPREADS:
        tried = solver.solve(extension, spread)
        touching = find_own_overlaps(body.view, tried.joint_pos).keys() - always
        if tried.is_solved and not any(set(pair) & arms for pair in touching):
            return tried
    return stance
