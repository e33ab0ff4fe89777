"""Dead reckoning: where a robot without localization lies after it moved."""

from __future__ import annotations

from humanoid_getup.simulation.placement import Placement
from humanoid_getup.strategies.plan import MotionPlan, RisePlan


class DeadReckoning:
    """Estimates where a robot lies: at a given place at first, then where its moves should end.

    Attitude and joint angles are measured; an error in place or heading is not noticed.
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
