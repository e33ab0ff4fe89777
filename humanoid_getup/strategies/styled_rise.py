"""Styled rise: a policy follows the curves of a planned motion, with feedback."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from humanoid_getup.motions.motion import Motion
from humanoid_getup.scenes.ground import FLAT, Ground
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.learned_rise import LearnedRise
from humanoid_getup.strategies.plan import MotionPlan, RisePlan, RiseStatus, Strategy
from humanoid_getup.style.curves import StyleCurves
from humanoid_getup.style.extraction import ExtractionError, extract_curves, measure_features
from humanoid_getup.style.style import Style
from robots import Posture, Robot
from robots.kinematics import place_postures
from robots.quaternion import Array

PLANNED = "planned"
"""Name that stands for the curves of a plan."""


class StyledRise:
    """Plans a motion, and lets a policy follow its style curves."""

    def __init__(self, learned: LearnedRise, planner: Strategy) -> None:
        """Combine a policy that follows style curves with a planner of the same world.

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
        """Plan a motion; return the policy with its curves, or the plan if it has no motion.

        A motion that ends lower than a stand has no curves: then there is nothing to play.
        """
        planned = self._planner.plan(start, rng)
        if not isinstance(planned, MotionPlan) or not planned.motion.rises:
            return planned
        try:
            curves = read_curves(self.world, planned.motion)
        except ExtractionError as error:
            return RisePlan(status=RiseStatus.FELL, detail=str(error), planned=planned.planned)
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


def read_curves(world: World, motion: Motion) -> StyleCurves:
    """Extract the style curves of a motion in a world.

    Raises:
        ExtractionError: if it does not end standing.
    """
    features = measure_motion(world.robot, motion, world.scene.ground)
    return extract_curves(motion.time, features)


def measure_motion(robot: Robot, motion: Motion, ground: Ground = FLAT) -> Array:
    """Measure the style features (T, 3) of a robot's motion."""
    model = robot.spec().compile()
    qpos = place_postures(robot, model, motion.position, motion.orientation, motion.joint_pos)
    return measure_features(robot, model, qpos, ground)
