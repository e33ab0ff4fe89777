"""The stance of an imported robot: as high as balance permits, its arms clear of its body."""

from __future__ import annotations

import numpy as np

from robots.body.balanced_stance import SPREADS, BalancedStance, StanceSolver
from robots.body.body_plan import BodyPlan
from robots.model_import.brackets import find_brackets, find_own_overlaps
from robots.quaternion import Array

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
    arms = _find_arm_bodies(body)
    for spread in SPREADS:
        tried = solver.solve(extension, spread)
        touching = find_own_overlaps(body.view, tried.joint_pos).keys() - always
        if tried.is_solved and not any(set(pair) & arms for pair in touching):
            return tried
    return stance


def _find_arm_bodies(body: BodyPlan) -> set[int]:
    """Find the bodies that arms move, without those of their first hinges."""
    moved = [body.view.ids[k] for pair in body.arms for limb in pair for k in limb[1:]]
    return set(body.model.jnt_bodyid[moved].tolist())
