"""Evaluation of a policy from falls, under perturbations, in pieces that workers do."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any

import numpy as np

from humanoid_getup.experiments.disturbances import Disturbance, RandomAxis
from humanoid_getup.experiments.falls import CLASSES, Fall, FallSet, sample_fall_set
from humanoid_getup.experiments.judging.record import combine_arrays
from humanoid_getup.planning.planner_settings import PlannerSettings
from humanoid_getup.policy.onnx_policy import OnnxPolicy, find_policy
from humanoid_getup.policy.style_follower import StyleChoice
from humanoid_getup.progress.callback import Progress
from humanoid_getup.progress.worker import report
from humanoid_getup.scenes.named_scenes import load_scene
from humanoid_getup.scenes.scene import FLAT_SCENE, Scene
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.learned_rise import PLANNED, read_curves
from humanoid_getup.strategies.planned_rise import PlannedRise
from humanoid_getup.style.curves import ExtractionError, StyleCurves
from humanoid_getup.style.style import Style, load_any_style, load_style
from robots import Posture, Robot, TorqueLimit, load_robot
from robots.kinematics import place
from robots.servo import LimitMode
from sim2real.environment.env_options import NOISE
from sim2real.environment.training_simulation import TrainingSim
from sim2real.environment.training_world import (
    LONGEST_DELAY,
    MODEL_VARIANTS,
    ModelVariant,
    backlash,
    build_training_world,
)
from sim2real.policy_evaluation import (
    DURATION,
    PolicyFigures,
    PolicyRollouts,
    PolicyRun,
)

PHYSICS_STEP = 0.002  # s, the twin's
PUSH_EVERY = 1.0  # s
CHUNK = 250  # robots simulated at once
REPORTED = 25  # policy steps between two reports of progress
LABELS = {
    "torque_limit": ("torque limit", " N·m"),
    "limit_by": ("limit by", ""),
    "action_delay": ("delay", " s"),
    "voltage": ("voltage", " V"),
    "friction": ("friction", ""),
    "mass": ("mass", ""),
    "hinge_backlash": ("backlash", " rad"),
    "weak_servo": ("weak servo", ""),
    "push": ("push", " m/s"),
    "imu_tilt": ("imu tilt", " rad"),
    "gyro_bias": ("gyro bias", " rad/s"),
    "noise": ("noise", ""),
    "physics": ("physics", ""),
}
"""Words and unit of each field of a perturbation that tables show."""


@dataclass(frozen=True, kw_only=True)
class Perturbation(Disturbance):
    """A disturbance of all robots of a trial, with what acts on them and in their physics."""

    torque_limit: float | None = None
    """Torque limit of every servo [N·m]."""
    limit_by: LimitMode | None = None
    """What the torque limit acts on; ``None`` for the robot's own."""
    hinge_backlash: float = 0.0
    """Backlash of every gear, from end to end [rad], by a hinge with stops in its model."""
    push: float = 0.0
    """Velocity change by a push in a random direction, once a second [m/s]."""
    noise: bool = False
    """Whether sensors have the noise of training."""
    physics: str | None = None
    """Name of one of ``MODEL_VARIANTS``."""

    @property
    def label(self) -> str:
        """Describe the differences from the robot's description."""
        parts = []
        for name, (words, unit) in LABELS.items():
            value = getattr(self, name)
            if value != getattr(Perturbation, name):
                value = value.length if isinstance(value, RandomAxis) else value
                shown = f"{value:.3g}" if isinstance(value, float) else str(value)
                parts.append(f"{words} {shown}{unit}")
        return ", ".join(parts) or "as described"


@dataclass(frozen=True, kw_only=True)
class PolicyTrial:
    """A policy on its robot under a perturbation."""

    policy: OnnxPolicy
    choose_style: StyleChoice | None = None
    """Chooses the curves that each robot follows, for a policy with style curves."""
    sees_ground: bool = False
    """Whether a policy with a height map gets the true one instead of a flat one."""
    perturbation: Perturbation = Perturbation()
    seed: int = 0
    """Seed of weak servos, pushes, the IMU's axis and noise."""
    scene: Scene = FLAT_SCENE
    duration: float = DURATION
    """Of each rollout [s]."""
    threads: int = 0

    def run(
        self, starts: Sequence[Posture], report: Callable[[float], None] = lambda _: None
    ) -> PolicyRollouts:
        """Roll out the policy from each start, in chunks.

        The work done is reported in robots, in parts while they move.
        """
        world, rng = self._build_world(), np.random.default_rng(self.seed)
        rollouts = [
            self._roll_out(world, first, starts[first : first + CHUNK], rng, report)
            for first in range(0, len(starts), CHUNK)
        ]
        return combine_arrays(rollouts, np.concatenate)

    def _build_world(self) -> World:
        """Build the world with the perturbations of the model."""
        robot, perturbation = self.policy.robot, self.perturbation
        variants: list[ModelVariant] = []
        if perturbation.physics:
            variants.append(MODEL_VARIANTS[perturbation.physics])
        if perturbation.hinge_backlash:
            variants.append(backlash(perturbation.hinge_backlash))
        delays = LONGEST_DELAY if perturbation.action_delay else 0.0
        timestep = robot.choose_timestep(PHYSICS_STEP)
        return build_training_world(robot, self.scene, timestep, delays, variants)

    def _roll_out(
        self,
        world: World,
        first: int,
        starts: Sequence[Posture],
        rng: np.random.Generator,
        report: Callable[[float], None],
    ) -> PolicyRollouts:
        """Roll out the policy from some starts at once, of which the first has a number."""
        perturbation, action, choose = self.perturbation, self.policy.action, self.choose_style
        sim = TrainingSim(
            world,
            len(starts),
            cycles=action.cycles,
            pwm_limit=action.pwm_limit,
            threads=self.threads,
            noise=NOISE,
        )
        limit = TorqueLimit(perturbation.torque_limit, perturbation.limit_by)
        sim.set_parameters(sim.everyone, perturbation.draw(world, sim.n, rng, limit))
        steps = round(self.duration / sim.step_time)

        def on_step(step: int) -> None:
            if step and step % REPORTED == 0:
                report(sim.n * REPORTED / steps)
            _push(sim, perturbation.push, rng, step)

        run = PolicyRun(
            sim=sim,
            policy=self.policy,
            choose_style=choose and (lambda row, features: choose(first + row, features)),
            sees_ground=self.sees_ground,
            duration=self.duration,
            rng=rng if perturbation.noise else None,
            on_step=on_step,
        )
        found = run.run(np.array([place(world.robot, world.model, start) for start in starts]))
        report(sim.n * (1.0 - (steps - 1) // REPORTED * REPORTED / steps))
        return found


def _push(sim: TrainingSim, speed: float, rng: np.random.Generator, step: int) -> None:
    """Push every robot in a random horizontal direction, in the middle of each period."""
    every = round(PUSH_EVERY / sim.step_time)
    if not speed or step % every != every // 2:
        return
    angle = rng.uniform(0.0, 2.0 * np.pi, sim.n)
    velocity = speed * np.stack([np.cos(angle), np.sin(angle), np.zeros(sim.n)], axis=1)
    sim.push(sim.everyone, velocity)


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


def cut_falls(grounds: Grounds, style: str | None, seed: int) -> list[RolloutPiece]:
    """Cut the falls on grounds into pieces of at most `CHUNK` robots, with seeds."""
    parts = [
        (ground, falls.falls, first)
        for ground, falls in grounds
        for first in range(0, len(falls.falls), CHUNK)
    ]
    return [
        RolloutPiece(
            ground=ground,
            falls=falls[first : first + CHUNK],
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
            stood_paper=rollouts.stood_paper,
            nearest=rollouts.nearest,
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
