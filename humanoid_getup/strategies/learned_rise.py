"""Learned rise: a policy runs instead of a planned motion, or follows the curves of one."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np

from humanoid_getup.motions.motion import Motion
from humanoid_getup.policy.onnx_policy import OnnxPolicy, find_policy
from humanoid_getup.scenes.ground import FLAT, Ground
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.plan import Plan, RiseStatus, Strategy
from humanoid_getup.style.curves import (
    ExtractionError,
    StyleCurves,
    extract_curves,
    measure_features,
)
from humanoid_getup.style.style import Style, load_style
from robots import FULL_TORQUE, Posture, Robot, TorqueLimit
from robots.arguments import expect
from robots.kinematics import place_postures
from robots.quaternion import Array
from robots.torque_limit import check_torque_limit


class LearnedRise:
    """Runs one policy, for every start."""

    def __init__(
        self,
        world: World,
        policy: OnnxPolicy | str | Path,
        *,
        torque_limit: TorqueLimit = FULL_TORQUE,
        name: str | None = None,
        style: Style | str | None = None,
    ) -> None:
        """Load a policy, or take a loaded one.

        Args:
            policy: Name of one of the robot's policies, an .onnx file, or a loaded policy.
            torque_limit: A loaded policy must have been loaded with it.
            name: For reports; ``None`` for the name of the file.
            style: What a policy that follows style curves should follow: a style, its name or
                file; ``None`` to choose among all named ones, as `Style.choose` does.
        """
        expect("world", world, World, "a World, e.g. World(robot)")
        self.world, self.torque_limit = world, check_torque_limit(torque_limit, world.robot)
        if not isinstance(policy, OnnxPolicy):
            file, robot = find_policy(world.robot, str(policy)), world.robot
            name = name or file.stem
            policy = OnnxPolicy.load(file, robot, torque_limit=torque_limit.value)
        if policy.torque_limit != torque_limit.value:
            raise ValueError(
                f"the policy was loaded with a torque limit of {policy.torque_limit} N·m, "
                f"expected {torque_limit.value} N·m as the strategy has"
            )
        if style is not None:
            given = style if isinstance(style, Style) else load_style(style, world.robot)
            policy = policy.following(given)
        self.policy = policy
        """The loaded policy, with the style that it follows."""
        self.name = name or "policy"
        """For reports."""

    def plan(self, start: Posture, _rng: np.random.Generator) -> Plan:
        """Plan to run the policy; with a style, a copy that records how it followed it."""
        style = self.policy.style
        slope = self.world.scene.slope
        policy = self.policy.following(style, slope, start) if style else self.policy
        return Plan(status=RiseStatus.LEARNED, policy=policy, policy_name=self.name)


PLANNED = "planned"
"""Name that stands for the curves of a plan."""


class StyledRise:
    """Plans a motion, and lets a policy follow its style curves."""

    def __init__(self, learned: LearnedRise, planner: Strategy) -> None:
        """Combine a policy that follows style curves with a planner of the same world."""
        if learned.policy.contract.style is None:
            raise ValueError(
                f"policy '{learned.name}' follows no style curves, expected no style with it"
            )
        self.world, self.torque_limit = learned.world, learned.torque_limit
        self._learned, self._planner = learned, planner

    def plan(self, start: Posture, rng: np.random.Generator) -> Plan:
        """Plan a motion; return the policy with its curves, or the plan if it has no motion.

        A motion that ends lower than a stand has no curves: then there is nothing to play.
        """
        planned = self._planner.plan(start, rng)
        if planned.motion is None or not planned.motion.rises:
            return planned
        try:
            curves = read_curves(self.world, planned.motion)
        except ExtractionError as error:
            return Plan(status=RiseStatus.FELL, detail=str(error), planned=planned.planned)
        style = Style(name=PLANNED, curves=(curves,))
        policy = self._learned.policy.following(style, self.world.scene.slope, start)
        return replace(
            planned,
            status=RiseStatus.LEARNED,
            motion=None,
            policy=policy,
            policy_name=self._learned.name,
            robust=math.nan,
            keys=(),
        )


def read_curves(world: World, motion: Motion) -> StyleCurves:
    """Extract the style curves of a motion that ends standing in a world."""
    features = measure_motion(world.robot, motion, world.scene.ground)
    return extract_curves(motion.time, features)


def measure_motion(robot: Robot, motion: Motion, ground: Ground = FLAT) -> Array:
    """Measure the style features (T, 3) of a robot's motion."""
    model = robot.spec().compile()
    qpos = place_postures(robot, model, motion.position, motion.orientation, motion.joint_pos)
    return measure_features(robot, model, qpos, ground)
