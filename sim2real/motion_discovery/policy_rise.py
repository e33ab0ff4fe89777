"""Rises of policies: the targets sent to the servos from lying to a stand, shaped to motions."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d

from humanoid_getup.experiments.falls import sample_falls
from humanoid_getup.experiments.judging.lying import LyingSide
from humanoid_getup.motions.build import lay_down_at_random
from humanoid_getup.motions.keyframes import SPEED_SHARE
from humanoid_getup.policy.onnx_policy import OnnxPolicy
from humanoid_getup.simulation.world import World
from robots import Robot
from robots.kinematics import place, read_posture
from robots.quaternion import Array
from robots.smooth_step import smooth_step
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


BALANCING = 1.0  # s of balancing by the policy that belong to a rise, until the robot is steady
HOMING = 0.5  # s, shortest time in which the targets move on to the standing posture
PEAK = 1.5  # highest speed of a smooth step over its mean
SMOOTHINGS = (0.08, 0.05, 0.025, 0.0)
"""Standard deviations of the low-pass filter that are tried, the strongest first [s].

A policy of rates moves targets back and forth in steps of 48 ms; half of that hardly changes them.
"""


def shape(robot: Robot, rise: PolicyRise, smoothing: float) -> Array:
    """Smooth the targets of a rise, and end them in the standing posture, (T, n) [rad].

    Where they are faster than the servos, as those of a policy that turns back from an obstacle,
    they follow as fast as these can.
    """
    period = robot.control_period
    count = min(round((rise.stand_time + BALANCING) / period), len(rise.target))
    fastest = SPEED_SHARE * robot.max_velocity
    target = _limit_steps(_smooth(rise.target[:count], smoothing / period), fastest * period)
    way = robot.standing.joint_pos - target[-1]
    duration = max(HOMING, PEAK * float((np.abs(way) / fastest).max()))
    share = smooth_step(np.linspace(0.0, 1.0, math.ceil(duration / period) + 1))[1:, None]
    return np.concatenate([target, target[-1] + share * way])


def _smooth(target: Array, deviation: float) -> Array:
    """Filter targets (T, n) by a Gaussian with a width in frames; both ends stay."""
    if deviation <= 0.0:
        return target
    smooth = gaussian_filter1d(target, deviation, axis=0, mode="nearest")
    fade = np.clip(np.arange(len(target)) / (3.0 * deviation), 0.0, 1.0)[:, None]
    fade = np.minimum(fade, fade[::-1])
    return target + fade * (smooth - target)


def _limit_steps(target: Array, most: Array) -> Array:
    """Follow targets (T, n) by limited steps, (n,)."""
    followed = target.copy()
    for k in range(1, len(target)):
        followed[k] = followed[k - 1] + np.clip(target[k] - followed[k - 1], -most, most)
    return followed
