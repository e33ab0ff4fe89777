"""Shaping: converts the targets of a policy to targets of a motion."""

from __future__ import annotations

import math

import numpy as np
from scipy.ndimage import gaussian_filter1d

from humanoid_getup.motions.keyframes import SPEED_SHARE
from robots import Robot
from robots.quaternion import Array
from robots.smooth_step import smooth_step
from sim2real.motion_discovery.policy_rise import PolicyRise

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
