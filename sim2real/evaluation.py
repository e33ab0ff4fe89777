"""Evaluation of a policy from falls, in pieces that workers do."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any

import numpy as np

from humanoid_getup.experiments.falls import CLASSES, Fall, FallSet, sample_fall_set
from humanoid_getup.planning.planner_settings import PlannerSettings
from humanoid_getup.policy.onnx_policy import OnnxPolicy, find_policy
from humanoid_getup.policy.style_follower import StyleChoice
from humanoid_getup.progress.callback import Progress
from humanoid_getup.progress.worker import report
from humanoid_getup.scenes.named_scenes import load_scene
from humanoid_getup.scenes.scene import Scene
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.learned_rise import PLANNED, read_curves
from humanoid_getup.strategies.planned_rise import PlannedRise
from humanoid_getup.style.curves import ExtractionError, StyleCurves
from humanoid_getup.style.style import Style, load_any_style, load_style
from robots import Robot, load_robot
from sim2real.perturbations import Perturbation, PolicyTrial
from sim2real.policy_evaluation import PolicyFigures

NEAREST = "nearest"
"""Style without a choice: the nearest of all named ones."""
PLAN_SHARE = 0.9
"""Of the time that a planned rise takes, where a policy follows the curves of its plan."""


@dataclass(frozen=True, kw_only=True)
class SeededScene:
    """A scene, with the seed of its ground if that is random."""

    name: str
    """Its name, or the absolute path of its file."""
    seed: int

    def load(self, robot: Robot) -> Scene:
        """Load the scene for a robot."""
        return load_scene(self.name, robot, self.seed)


Grounds = list[tuple[SeededScene, FallSet]]
"""Each ground with the falls on it."""


@dataclass(frozen=True, kw_only=True)
class RolloutPiece:
    """Rollouts of a policy from some falls on one ground, at once."""

    ground: SeededScene
    falls: tuple[Fall, ...]
    first: int
    """Number of the first of the falls among those on this ground."""
    style: str | None
    """Name or file of the style that it follows; None for a policy without style curves."""
    seed: int
    """Of what is random about its robots."""


def cut_falls(grounds: Grounds, style: str | None, *, most: int, seed: int) -> list[RolloutPiece]:
    """Cut the falls on grounds into pieces of at most a number of robots, with seeds."""
    parts = [
        (ground, falls.falls, first)
        for ground, falls in grounds
        for first in range(0, len(falls.falls), most)
    ]
    return [
        RolloutPiece(
            ground=ground,
            falls=falls[first : first + most],
            first=first,
            style=style,
            seed=seed * len(parts) + number,
        )
        for number, (ground, falls, first) in enumerate(parts)
    ]


def load_followed(name: str, robot: Robot) -> Style:
    """Load a style to follow, by name; for curves of plans, that of falls without one."""
    return load_any_style(robot) if name in (NEAREST, PLANNED) else load_style(name, robot)


@dataclass(frozen=True, kw_only=True)
class EvaluatedPolicy:
    """A policy under a perturbation; each worker loads it and its robot itself."""

    robot_name: str
    """Name or folder of the robot."""
    policy_name: str
    """Name of the policy, or its file."""
    perturbation: Perturbation
    sees_ground: bool
    """Whether a policy with a height map observes the ground."""
    seed: int
    """Seed of plans, whose curves the policy follows."""
    threads: int = 0

    def __getstate__(self) -> dict[str, Any]:
        return {field.name: getattr(self, field.name) for field in fields(self)} | {"threads": 1}

    @cached_property
    def robot(self) -> Robot:
        """Load the robot."""
        return load_robot(self.robot_name)

    @cached_property
    def policy(self) -> OnnxPolicy:
        """Load the policy."""
        robot, limit = self.robot, self.perturbation.torque_limit
        file = find_policy(robot, self.policy_name)
        return OnnxPolicy.load(file, robot, robot.control_period, limit)

    def sample_falls(self, ground: SeededScene) -> FallSet:
        """Sample a fall of each class on a ground."""
        world = World(self.robot, ground.load(self.robot))
        return sample_fall_set(world, dict.fromkeys(CLASSES, 1), ground.seed)

    def roll_out(self, piece: RolloutPiece) -> PolicyFigures:
        """Let the policy get up from falls, and report robots as they are done."""
        planned = self._plan_curves(piece) if piece.style == PLANNED else []
        trial = PolicyTrial(
            policy=self.policy,
            choose_style=self._choose_curves(piece.style, planned),
            sees_ground=self.sees_ground,
            perturbation=self.perturbation,
            seed=piece.seed,
            scene=piece.ground.load(self.robot),
            threads=self.threads,
        )
        share = 1.0 - PLAN_SHARE if planned else 1.0
        starts = [fall.posture for fall in piece.falls]
        rollouts = trial.run(starts, lambda robots: report(Progress(done=share * robots)))
        return PolicyFigures(  # smaller by far than the rollouts
            outcome=rollouts.outcome,
            style_error=rollouts.style_error,
            restarts=rollouts.restarts,
            planned=np.array([each is not None for each in planned]) if planned else None,
        )

    def _choose_curves(
        self, style: str | None, planned: Sequence[StyleCurves | None]
    ) -> StyleChoice | None:
        """Make the choice of curves: those that were planned for a fall, or else a style's."""
        if style is None:
            return None
        named = load_followed(style, self.robot)
        curves = dict(enumerate(planned))
        return lambda row, features: curves.get(row) or named.choose(features)

    def _plan_curves(self, piece: RolloutPiece) -> list[StyleCurves | None]:
        """Plan a motion for each fall, and read its curves; ``None`` where no plan stands."""
        world = World(self.robot, piece.ground.load(self.robot))
        planner = PlannedRise(world, settings=PlannerSettings(threads=self.threads))
        found: list[StyleCurves | None] = []
        for number, fall in enumerate(piece.falls, piece.first):
            plan = planner.plan(fall.posture, np.random.default_rng([self.seed, number]))
            found.append(None)
            if plan.motion is not None and plan.motion.rises:
                with suppress(ExtractionError):
                    found[-1] = read_curves(world, plan.motion)
            report(Progress(done=PLAN_SHARE))
        return found
