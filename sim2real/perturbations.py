"""Perturbations: evaluation of a policy on robots that differ from their description."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from humanoid_getup.experiments.disturbances import Disturbance, RandomAxis
from humanoid_getup.experiments.falls import Fall
from humanoid_getup.experiments.judging.summary import (
    PolicyClasses,
    PolicySummary,
    summarize,
    wilson_interval,
)
from humanoid_getup.policy.onnx_policy import OnnxPolicy
from humanoid_getup.policy.style_follower import StyleChoice
from humanoid_getup.scenes.scene import FLAT_SCENE, Scene
from humanoid_getup.simulation.world import World
from robots import Posture, TorqueLimit
from robots.kinematics import place
from robots.quaternion import Array
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
    join_rollouts,
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
        return join_rollouts(rollouts)

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


def summarize_rollouts(
    starts: Sequence[Fall], rollouts: PolicyFigures, classes: Sequence[str]
) -> PolicyClasses:
    """Summarize by class and over all: counts, intervals, times [s], load, impact."""
    kinds = np.array([fall.start_class for fall in starts])
    outcome, error = rollouts.outcome, rollouts.style_error
    unknown = np.full(len(kinds), np.nan)
    columns = {
        "stand_time_s": outcome.stand_time,
        "rms_torque_nm": np.where(outcome.stood, outcome.rms_torque, np.nan),
        "peak_torque_nm": outcome.peak_torque,
        "peak_braking_torque_nm": outcome.peak_braking_torque,
        "head_impact_m_s": unknown if outcome.head_impact is None else outcome.head_impact,
        "height_error": error[:, 0],
        "angle_error_deg": np.degrees(error[:, 1:].mean(axis=1)),
        "restarts": rollouts.restarts.astype(float),
        "standing_joint_speed_rad_s": outcome.standing_speed,
    }
    everyone = np.ones(len(kinds), dtype=bool)
    return PolicyClasses(
        classes={name: _summarize_rows(outcome.stood, columns, kinds == name) for name in classes},
        all=_summarize_rows(outcome.stood, columns, everyone),
    )


def _summarize_rows(
    stood: NDArray[np.bool_], columns: dict[str, Array], rows: NDArray[np.bool_]
) -> PolicySummary:
    n, successes = int(rows.sum()), int(stood[rows].sum())
    return PolicySummary(
        n=n,
        stood=successes,
        stood_interval_95=wilson_interval(successes, n),
        **{name: summarize(values[rows]) for name, values in columns.items()},
    )


def _push(sim: TrainingSim, speed: float, rng: np.random.Generator, step: int) -> None:
    """Push every robot in a random horizontal direction, in the middle of each period."""
    every = round(PUSH_EVERY / sim.step_time)
    if not speed or step % every != every // 2:
        return
    angle = rng.uniform(0.0, 2.0 * np.pi, sim.n)
    velocity = speed * np.stack([np.cos(angle), np.sin(angle), np.zeros(sim.n)], axis=1)
    sim.push(sim.everyone, velocity)
