"""Rises of policies: the targets sent to the servos from lying to a stand."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from humanoid_getup.experiments.judging.lying import LyingSide
from humanoid_getup.experiments.starts.falls import sample_falls
from humanoid_getup.motions.build import lay_down_at_random
from humanoid_getup.policy.onnx_policy import OnnxPolicy
from humanoid_getup.simulation.world import World
from robots.kinematics import place, read_posture
from robots.quaternion import Array
from sim2real.perturbations import PolicyTrial
from sim2real.policy_evaluation import PolicyDriver


@dataclass(frozen=True, kw_only=True, eq=False)
class PolicyRise:
    """One rise of a policy that stood, undisturbed."""

    start_class: LyingSide
    start: Array
    """MuJoCo positions of the lying robot, (nq,)."""
    target: Array
    """Targets of the servos at each control period [rad], (T, n); the first are the angles of the
    lying robot, the last ones still balance it."""
    stand_time: float
    """Time at which its held stand began [s]."""


def collect_rises(
    world: World, policy: OnnxPolicy, start_class: LyingSide, count: int, rng: np.random.Generator
) -> list[PolicyRise]:
    """Let a policy rise from postures on one side; return the rises that stood.

    Half of the robots lie as they fell, half as people would lay them: straight, both sides alike.
    """
    fallen = sample_falls(world, {start_class: count // 2}, rng)
    starts = [place(world.robot, world.model, fall.posture) for fall in fallen]
    starts += [lay_down_at_random(world, start_class, rng) for _ in range(count - len(starts))]
    postures = [read_posture(world.robot, world.model, qpos) for qpos in starts]
    driver = PolicyDriver.of(policy)
    found = PolicyTrial(robot=world.robot, policy=driver, scene=world.scene).run(postures)
    times = found.outcome.stand_time.tolist()
    return [
        PolicyRise(
            start_class=start_class,
            start=start,
            target=_interpolate(posture.joint_pos, target, policy.action.cycles),
            stand_time=time,
        )
        for start, posture, target, time in zip(starts, postures, found.target, times, strict=True)
        if not math.isnan(time)
    ]


def _interpolate(first: Array, target: Array, cycles: int) -> Array:
    """Sample targets of policy steps (S, n) at every control period from angles (n,)."""
    knots = np.arange(len(target) + 1) * cycles
    rows = np.concatenate([first[None], target])
    time = np.arange(knots[-1] + 1)
    return np.stack([np.interp(time, knots, column) for column in rows.T], axis=1)
