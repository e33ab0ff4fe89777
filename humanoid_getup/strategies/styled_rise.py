"""A policy that follows the curves of a planned motion: it rises as planned, with feedback."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from humanoid_getup.motions.motion import Motion
from humanoid_getup.strategies.learned_rise import LearnedRise
from humanoid_getup.strategies.plan import MotionPlan, RisePlan, Strategy
from humanoid_getup.style.curves import StyleCurves
from humanoid_getup.style.extraction import extract_curves, measure_features
from humanoid_getup.style.style import Style
from robots import Posture, Robot
from robots.kinematics import place_postures

PLANNED = "planned"
"""Name of the style that is the curves of a plan."""


class StyledRise:
    """Plans a motion, and lets a policy follow its style curves."""

    def __init__(self, learned: LearnedRise, planner: Strategy) -> None:
        """Join a policy that follows style curves with a planner of the same world.

        Raises:
            ValueError: if the policy follows no style curves.
        """
        if learned.policy.contract.style is None:
            raise ValueError(
                f"policy '{learned.name}' follows no style curves, expected no style with it"
            )
        self.world, self.torque_limit = learned.world, learned.torque_limit
        self._learned, self._planner = learned, planner

    def plan(self, start: Posture, rng: np.random.Generator) -> RisePlan:
        """Plan a motion; return the policy with its curves, or the plan if it has no motion."""
        planned = self._planner.plan(start, rng)
        if not isinstance(planned, MotionPlan) or not planned.motion.rises:
            return planned
        curves = read_curves(self.world.robot, planned.motion)
        policy = self._learned.policy.following(Style(name=PLANNED, curves=(curves,)))
        plan = self._learned.plan(start, rng)
        return replace(
            plan,
            policy=policy,
            connection=planned.connection,
            planned=planned.planned,
            plan_s=planned.plan_s,
            filter_s=planned.filter_s,
            rollouts=planned.rollouts,
            rounds=planned.rounds,
            search=planned.search,
        )


def read_curves(robot: Robot, motion: Motion) -> StyleCurves:
    """Extract the style curves of a robot's motion on level ground."""
    model = robot.spec().compile()
    qpos = place_postures(robot, model, motion.position, motion.orientation, motion.joint_pos)
    return extract_curves(motion.time, measure_features(robot, model, qpos))
