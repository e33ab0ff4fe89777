"""Dead reckoning: the place of a robot without localization after its moves."""

from __future__ import annotations

from humanoid_getup.simulation.placement import Placement
from humanoid_getup.strategies.plan import MotionPlan, RisePlan


class DeadReckoning:
    """Estimates the place of a robot: a given one at first, then the planned ends of its moves.

    Attitude and joint angles are measured; an error in place or heading is not noticed.
    """

    def __init__(self, placement: Placement) -> None:
        self._placement = placement

    def locate(self) -> Placement:
        """Return where the robot lies."""
        return self._placement

    def move(self, plan: RisePlan) -> None:
        """Advance to the planned end of a move."""
        if isinstance(plan, MotionPlan):
            self._placement = Placement.of(plan.motion.posture(-1))
