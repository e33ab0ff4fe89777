"""Reward terms and their weights."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from humanoid_getup.experiments.disturbances import MOST_DELAY
from humanoid_getup.policy.observation import ROTATION, SAME, VECTOR, Mirror
from humanoid_getup.simulation.domain_parameters import DomainParameters
from humanoid_getup.style.followed_style import ANGLE_WEIGHT, HEIGHT_WEIGHT
from robots import Robot
from robots.quaternion import Array


@dataclass(frozen=True, kw_only=True, eq=False)
class PrivilegedState:
    """Quantities of N robots that only a simulation can measure.

    Lengths are in standing neck heights, unless they have a unit.
    """

    height: Array
    """Height of the neck over the ground, (N,)."""
    stretch: Array
    """Height of the neck over the mean of the soles, (N,)."""
    sole_height: Array
    """Mean height of the soles, (N,)."""
    sole_heights: Array
    """Height of each sole over the ground, (N, soles)."""
    sole_distance: Array
    """Horizontal distance of the soles' center from the neck, (N,)."""
    upright: Array
    """Cosine of the torso's tilt, (N,)."""
    standing: NDArray[np.bool_]
    """Whether the standing condition holds, (N,)."""
    non_foot_contact: NDArray[np.bool_]
    """Whether anything but the feet touches the world, (N,)."""
    root_vel: Array
    """Linear (world) and angular (torso) velocity of the torso [m/s, rad/s], (N, 6)."""
    joint_speed: Array
    """Fraction of the servos' no-load speed, (N, n)."""
    torque: Array
    """Fraction of the servos' stall torque, (N, n)."""
    fall_speed: Array
    """Downward speed of the torso [1/s], (N,)."""
    head_contact: NDArray[np.bool_]
    """Whether the head touches the world; False without a head, (N,)."""
    head_fall: Array
    """Downward speed of the head [1/s]; 0 without a head, (N,)."""


@dataclass(frozen=True, eq=False)
class CriticTerm:
    """A part of the critic's observation, with its mirror image."""

    read: Callable[[PrivilegedState, DomainParameters], NDArray[Any]]
    """Computes the values, (N, size) or (N,)."""
    mirror: Mirror


def list_critic_terms(robot: Robot) -> tuple[CriticTerm, ...]:
    """List the terms that follow the policy's observation, in order."""
    soles = len(robot.sole_sites)
    swapped = Mirror(np.arange(soles)[::-1], np.ones(soles))
    joints = Mirror(robot.mirror_index, robot.mirror_sign)
    return (
        CriticTerm(lambda s, _: s.height, SAME),
        CriticTerm(lambda s, _: s.sole_heights, swapped),
        CriticTerm(lambda s, _: s.sole_distance, SAME),
        CriticTerm(lambda s, _: s.upright, SAME),
        CriticTerm(lambda s, _: s.non_foot_contact, SAME),
        CriticTerm(lambda s, _: s.root_vel[:, :3], VECTOR),
        CriticTerm(lambda s, _: s.root_vel[:, 3:], ROTATION),
        CriticTerm(lambda s, _: s.torque, joints),
        CriticTerm(lambda _, p: p.friction, SAME),
        CriticTerm(lambda _, p: p.voltage / robot.supply_voltage, SAME),
        CriticTerm(lambda _, p: p.mass.mean(axis=1), SAME),
        CriticTerm(lambda _, p: p.action_delay / MOST_DELAY, SAME),
        CriticTerm(lambda _, p: p.sensor_delay / MOST_DELAY, SAME),
    )


SPEED_WEIGHT = 0.05  # s/rad
POSTURE_WEIGHT = 0.1  # 1/rad
PHASE_WEIGHT = 20.0
MOST_OFFSET = 0.2  # rad per joint on average, at which the naturalness is 0: 10 for 49 joints


@dataclass(frozen=True, kw_only=True, eq=False)
class StyleReward:
    """The factors of the reward of [Frezzato22], equations (3) to (9), for N robots."""

    height: Array
    angles: Array
    stillness: Array
    posture: Array
    natural: Array

    @property
    def task(self) -> Array:
        """Return the task reward, equation (4), (N,)."""
        return self.height * self.angles * self.stillness * self.posture

    @property
    def total(self) -> Array:
        """Return the reward, equation (2), (N,)."""
        return self.task * self.natural


def reward_style(
    features: Array, wanted: Array, speed: Array, from_stance: Array, offsets: Array
) -> StyleReward:
    """Compute the reward of [Frezzato22], section 5.1.

    Args:
        features: Measured style features, (N, 3).
        wanted: Those of the curves, (N, 3).
        speed: Of joints and torso [rad/s], (N, m).
        from_stance: Of each joint from standing [rad], (N, n).
        offsets: Of each joint's target from the decoded posture [rad], (N, n).
    """
    error = np.abs(features - wanted)
    phase = np.exp(-PHASE_WEIGHT * np.maximum(1.0 - wanted[:, 0], 0.0))

    def count_at_end(value: Array) -> Array:
        """Weight a factor by the progress along the curve, equations (7) and (9)."""
        return (1.0 - phase) + phase * value

    offset = np.abs(offsets).mean(axis=1) / MOST_OFFSET
    return StyleReward(
        height=np.exp(-HEIGHT_WEIGHT * error[:, 0]),
        angles=np.exp(-ANGLE_WEIGHT * error[:, 1:].sum(axis=1)),
        stillness=count_at_end(np.exp(-SPEED_WEIGHT * np.linalg.norm(speed, axis=1))),
        posture=count_at_end(np.exp(-POSTURE_WEIGHT * np.abs(from_stance).sum(axis=1))),
        natural=1.0 - np.clip(offset**2, 0.0, 1.0),
    )


SOLES_LOW = 0.3  # fraction of the standing neck height
MOST_REQUESTED = 4.0  # unclipped action from which the cost saturates
UNDER_TORSO = 0.5  # fraction of the standing neck height
HALF_TURN = np.pi  # rad
NECK_LOW = 0.4  # fraction of the standing neck height, below which the head may hit the ground


@dataclass(frozen=True, kw_only=True, eq=False)
class RewardInputs(PrivilegedState):
    """Inputs of the reward terms for N robots."""

    requested: Array
    """Outputs of the network before clipping, as shares of the largest, (N, m)."""
    action: Array
    """Memory of the policy, (N, m): the clipped actions, or filtered outputs
    with style curves."""
    last_action: Array
    """The same of the last policy step, (N, m)."""
    away: Array
    """Angle of each joint from standing [rad], (N, n)."""
    style: StyleReward | None = None
    """Closeness of the robots to style curves; ``None`` without curves."""


def way_up(m: RewardInputs) -> Array:
    """Reward height, an upright torso and low soles, as at the beginning of every rise."""
    up = 0.5 * (1.0 + m.upright)
    return np.clip(m.height, 0.0, 1.0) ** 2 * up * np.exp(-((m.sole_height / SOLES_LOW) ** 2))


def over_feet(m: RewardInputs) -> Array:
    """Reward a neck high over the soles, with the soles under it; sitting gains nothing."""
    up = 0.5 * (1.0 + m.upright)
    under = np.exp(-((m.sole_distance / UNDER_TORSO) ** 2))
    return np.clip(m.stretch, 0.0, 1.0) ** 2 * up**2 * under


def stands(m: RewardInputs) -> Array:
    """Reward the standing condition, by which success is counted."""
    return m.standing.astype(float)


def stance(m: RewardInputs) -> Array:
    """Reward joints near their standing angles while standing: walking starts there."""
    return m.standing * np.exp(-2.0 * m.away**2).mean(axis=1)


def at_ease(m: RewardInputs) -> Array:
    """Reward joints for approaching their standing angles while standing, from any distance.

    A reward that vanishes far from home leaves the arms where they were swung.
    """
    return m.standing * np.clip(1.0 - np.abs(m.away) / HALF_TURN, 0.0, 1.0).mean(axis=1)


def haste(m: RewardInputs) -> Array:
    """Penalize unclipped actions: beyond saturation no gradient leads back."""
    return np.minimum(m.requested**2, MOST_REQUESTED**2).mean(axis=1)


def action_change(m: RewardInputs) -> Array:
    """Penalize changes of the action, which make servos shake."""
    return ((m.action - m.last_action) ** 2).mean(axis=1)


def joint_speed(m: RewardInputs) -> Array:
    """Penalize joint speed: fast limbs hit hard."""
    return (m.joint_speed**2).mean(axis=1)


def restless(m: RewardInputs) -> Array:
    """Penalize joint speed away from the standing angles while standing."""
    return m.standing * np.maximum(m.joint_speed * np.sign(m.away), 0.0).mean(axis=1)


def demanding(m: RewardInputs) -> Array:
    """Penalize unclipped actions while standing, which keep arms at their joint limits."""
    return m.standing * haste(m)


def torque(m: RewardInputs) -> Array:
    """Penalize torque: it heats servos and wears gears."""
    return (m.torque**2).mean(axis=1)


def dropping(m: RewardInputs) -> Array:
    """Penalize the torso's downward speed: hard landings break gears."""
    return m.fall_speed**2


def head_strike(m: RewardInputs) -> Array:
    """Penalize the head's downward speed near the ground: the head carries the cameras."""
    return m.head_fall**2 * np.exp(-((m.height / NECK_LOW) ** 2))


def follow_style(m: RewardInputs) -> Array:
    """Reward following the style curves by natural postures ([Frezzato22], equation 2)."""
    if m.style is None:
        raise ValueError("the rewards are those of style curves, expected a training with curves")
    return m.style.total


@dataclass(frozen=True)
class Reward:
    """A reward term and its weight."""

    term: Callable[[RewardInputs], Array]
    weight: float


# The sum is near 1 per policy step for a standing robot, so that returns are near 20.
RISE = (
    Reward(way_up, 0.40),  # effective from the first step on; smaller than the reward of standing
    Reward(over_feet, 0.80),  # takes over once the feet carry weight
    Reward(stands, 0.40),  # the goal itself
)
QUICK = (
    *RISE,
    Reward(stance, 0.10),
    Reward(action_change, -0.001),  # with larger weights, policies lie still
    Reward(joint_speed, -0.002),
)
ROBUST = (
    *RISE,
    Reward(at_ease, 2.00),  # brings arms down, with `demanding` and standing initial states
    Reward(haste, -0.05),
    Reward(action_change, -0.05),
    Reward(joint_speed, -0.02),
    Reward(restless, -3.00),  # full speed away from home costs most of the reward of standing
    Reward(demanding, -1.00),  # twenty times the weight of haste
    Reward(torque, -0.30),
    Reward(dropping, -0.02),
    Reward(head_strike, -0.20),
)
GENTLE = (
    *RISE,
    Reward(at_ease, 2.00),
    Reward(haste, -0.05),
    Reward(action_change, -0.05),
    Reward(joint_speed, -0.50),
    Reward(restless, -3.00),
    Reward(demanding, -1.00),
    # The PWM limit makes it gentle. Under that limit, weights of -6 and below on torque, and of
    # -1 to -3 on the other costs, made it lie still after falls from which it can rise.
    Reward(torque, -2.00),
    Reward(dropping, -0.50),
    Reward(head_strike, -10.00),  # 0.5 m/s cost five steps of standing
)
STYLED = (
    Reward(follow_style, 1.00),
    Reward(stands, 0.50),  # the goal, by which success is counted
    Reward(haste, -0.05),
    Reward(action_change, -0.02),
    Reward(joint_speed, -0.10),
    Reward(torque, -0.20),
    Reward(dropping, -0.02),
    Reward(head_strike, -0.50),
)
REWARDS = {"quick": QUICK, "robust": ROBUST, "gentle": GENTLE, "styled": STYLED}


def score(
    rewards: tuple[Reward, ...], inputs: RewardInputs, cost_share: float = 1.0
) -> tuple[Array, dict[str, Array]]:
    """Sum the weighted terms, (N,); return each of them as well.

    Terms of negative weight count by ``cost_share``: under full costs a policy that cannot rise
    yet would come to lie still.
    """
    parts = {
        r.term.__name__: r.weight * (cost_share if r.weight < 0.0 else 1.0) * r.term(inputs)
        for r in rewards
    }
    return np.sum(list(parts.values()), axis=0), parts
