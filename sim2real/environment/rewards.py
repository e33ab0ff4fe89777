"""Rewards: small pure functions of a moment, one place each, the reason beside the weight."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from humanoid_getup.evaluation.standing import is_upright
from robots import Robot
from robots.quaternion import Array
from sim2real.environment.privileged_state import PrivilegedState

SOLES_LOW = 0.3  # share of the standing neck height
MOST_ASKED = 4.0  # of an action's numbers from -1 to 1; beyond, nothing is counted any more
UNDER_TORSO = 0.5  # share of the standing neck height
HALF_TURN = np.pi  # rad
NECK_LOW = 0.4  # share of the standing neck height: about where the head can touch the ground


@dataclass(frozen=True, kw_only=True, eq=False)
class RewardInputs:
    """What rewards see of N robots; heights are shares of the robot's standing neck height."""

    height: Array
    """Of the neck over the ground, (N,)."""
    stretch: Array
    """Of the neck over the soles' middle, (N,)."""
    sole_height: Array
    """Mean height of the soles, (N,)."""
    sole_distance: Array
    """Horizontal distance of the soles' middle from the neck, (N,)."""
    upright: Array
    """Cosine of the torso's tilt, (N,)."""
    standing: NDArray[np.bool_]
    """Whether the shared definition of standing holds now, (N,)."""
    joint_speed: Array
    """Share of the servos' no-load speed, (N, n)."""
    torque: Array
    """Share of the servos' stall torque, (N, n)."""
    fall_speed: Array
    """Downward speed of the torso in standing neck heights a second, (N,)."""
    head_fall: Array
    """Downward speed of the head in standing neck heights a second, (N,)."""
    asked: Array
    """What the policy asked for, beyond -1 and 1, too, (N, k)."""
    action: Array
    """What of it counts, (N, k)."""
    last_action: Array
    """(N, k)"""
    away: Array
    """Distance of each joint from standing [rad], (N, n)."""

    @staticmethod
    def of(
        robot: Robot, state: PrivilegedState, joint_pos: Array, asked: Array, last_action: Array
    ) -> RewardInputs:
        """Normalize the privileged state."""
        size = robot.standing_neck_height
        soles, neck_height = state.sole_height.mean(axis=1), state.stance.neck_height
        return RewardInputs(
            height=neck_height / size,
            stretch=(neck_height - soles) / size,
            sole_height=soles / size,
            sole_distance=state.sole_distance / size,
            upright=state.upright,
            standing=is_upright(state.stance, robot),
            joint_speed=state.joint_vel / robot.max_velocity,
            torque=state.torque / robot.max_torque,
            fall_speed=np.maximum(-state.root_vel[:, 2], 0.0) / size,
            head_fall=state.head_fall / size,
            asked=asked,
            action=np.clip(asked, -1.0, 1.0),
            last_action=last_action,
            away=joint_pos - robot.standing.joint_pos,
        )


def way_up(m: RewardInputs) -> Array:
    """Reward height, an upright torso, and soles near the ground: any way up begins so."""
    up = 0.5 * (1.0 + m.upright)
    return np.clip(m.height, 0.0, 1.0) ** 2 * up * np.exp(-((m.sole_height / SOLES_LOW) ** 2))


def over_feet(m: RewardInputs) -> Array:
    """Reward a neck high over soles that are under the torso: sitting high is not that."""
    up = 0.5 * (1.0 + m.upright)
    under = np.exp(-((m.sole_distance / UNDER_TORSO) ** 2))
    return np.clip(m.stretch, 0.0, 1.0) ** 2 * up**2 * under


def stands(m: RewardInputs) -> Array:
    """Reward the shared definition of standing: what success is counted by."""
    return m.standing.astype(float)


def stance(m: RewardInputs) -> Array:
    """Reward each joint for its standing angle while standing: walking begins from there."""
    return m.standing * np.exp(-2.0 * m.away**2).mean(axis=1)


def at_ease(m: RewardInputs) -> Array:
    """Reward each joint for nearing its standing angle while standing, from however far.

    What fades far from home leaves the arms up where they were thrown.
    """
    return m.standing * np.clip(1.0 - np.abs(m.away) / HALF_TURN, 0.0, 1.0).mean(axis=1)


def haste(m: RewardInputs) -> Array:
    """Count what is asked for: who asks for more than all never learns to ask for less."""
    return np.minimum(m.asked**2, MOST_ASKED**2).mean(axis=1)


def action_change(m: RewardInputs) -> Array:
    """Count the change of action: servos that are told to shake do shake."""
    return ((m.action - m.last_action) ** 2).mean(axis=1)


def joint_speed(m: RewardInputs) -> Array:
    """Count the speed of the joints: what is fast hits hard."""
    return (m.joint_speed**2).mean(axis=1)


def restless(m: RewardInputs) -> Array:
    """Count joint speed away from home while standing: who stands goes home or stands still."""
    return m.standing * np.maximum(m.joint_speed * np.sign(m.away), 0.0).mean(axis=1)


def demanding(m: RewardInputs) -> Array:
    """Count what is asked for while standing: arms pushed to their stops never come home."""
    return m.standing * haste(m)


def torque(m: RewardInputs) -> Array:
    """Count torque: it heats servos and wears gears."""
    return (m.torque**2).mean(axis=1)


def dropping(m: RewardInputs) -> Array:
    """Count the torso's downward speed: hard landings break gears."""
    return m.fall_speed**2


def head_strike(m: RewardInputs) -> Array:
    """Count the head's downward speed near the ground: it carries the cameras."""
    return m.head_fall**2 * np.exp(-((m.height / NECK_LOW) ** 2))


@dataclass(frozen=True)
class Reward:
    """A term and what it weighs."""

    term: Callable[[RewardInputs], Array]
    weight: float


# One policy step's sum is near 1 for a robot that stands, so that returns are near 20.
RISE = (
    Reward(way_up, 0.40),  # felt from the first step on; less than what standing gives
    Reward(over_feet, 0.80),  # takes over once the feet carry
    Reward(stands, 0.40),  # the goal itself
)
QUICK = (
    *RISE,
    Reward(stance, 0.10),
    Reward(action_change, -0.001),  # more before the rise is found teaches lying still
    Reward(joint_speed, -0.002),
)
ROBUST = (
    *RISE,
    Reward(at_ease, 2.00),  # arms come down by it, by `demanding`, and by starts that stand
    Reward(haste, -0.05),
    Reward(action_change, -0.05),
    Reward(joint_speed, -0.02),
    Reward(restless, -3.00),  # full speed away from home costs most of what standing gives
    Reward(demanding, -1.00),  # haste in a stand weighs twenty times that on the way
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
    # What makes it gentle is the limit on its servos. Under it, costs of torque -6 or more and
    # of all else -1 to -3 made it give up falls that it could win.
    Reward(torque, -2.00),
    Reward(dropping, -0.50),
    Reward(head_strike, -10.00),  # half a meter a second costs five steps of standing
)
REWARDS = {"quick": QUICK, "robust": ROBUST, "gentle": GENTLE}


def score(
    rewards: tuple[Reward, ...], inputs: RewardInputs, cost_share: float = 1.0
) -> tuple[Array, dict[str, Array]]:
    """Sum the weighted terms, (N,); return each of them, too.

    Args:
        rewards: Terms and weights.
        inputs: What they are computed from.
        cost_share: Share of the costs that counts: all of them before a rise is found teach
            lying still.
    """
    parts = {
        r.term.__name__: r.weight * (cost_share if r.weight < 0.0 else 1.0) * r.term(inputs)
        for r in rewards
    }
    return np.sum(list(parts.values()), axis=0), parts
