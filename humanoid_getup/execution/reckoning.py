"""Reckoning: where a robot that nobody watches lies after it moved."""

from __future__ import annotations

from humanoid_getup.simulation.placement import Placement
from humanoid_getup.strategies.plan import MotionPlan, RisePlan


class Reckoning:
    """Tells where a robot lies: where it was said to lie, and then where its moves should end.

    A move that ends elsewhere goes unnoticed, but for attitude and joints, which are measured.
    """

    def __init__(self, placement: Placement) -> None:
        self._placement = placement

    def locate(self) -> Placement:
        """Return where the robot lies."""
        return self._placement

    def move(self, plan: RisePlan) -> None:
        """Go on to the end of a move."""
        if isinstance(plan, MotionPlan):
            self._placement = Placement.of(plan.motion.posture(-1))
