"""Fits a policy that was trained elsewhere to a robot: its joints, its actions, its gains."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from humanoid_getup.policy.action import (
    HOMING_SHARE,
    SPEED_SHARE,
    ActionMode,
    ActionSpec,
    build_posture_spec,
)
from humanoid_getup.policy.foreign.description import COMMAND, ForeignPolicy, ForeignPolicyError
from humanoid_getup.policy.foreign.joint_names import map_joints
from humanoid_getup.policy.foreign.wrapping import Wrapping
from robots import Robot
from robots.quaternion import Array

NO_LEAD = 10.0  # rad of a target before its joint: more than joints turn, so none is cut
GAIN_SLACK = 0.01  # share of a servo's gain by which another one may exceed it
RATE_SLACK = 1e-6  # share
MOST_NAMED = 3  # joints in a message


def fit_policy(
    policy: ForeignPolicy, robot: Robot, renamed: Mapping[str, str] | None = None
) -> Wrapping:
    """Fit a policy to a robot.

    Raises:
        ForeignPolicyError: naming joints, gains or a rate that the robot does not have.
    """
    places = map_joints(policy.joints, robot, renamed)
    exact = 1.0 / (policy.rate * robot.control_period)
    cycles, shares = max(round(exact), 1), _share_gains(policy, robot, places)
    problems = _find_gain_problems(robot, shares)
    if abs(exact / cycles - 1.0) > RATE_SLACK:
        problems.insert(
            0,
            f"it steps at {policy.rate:g} Hz, robot '{robot.name}' every {exact:.3g} control "
            f"periods of {1e3 * robot.control_period:g} ms: expected a whole number, as with "
            f"control_period = {1.0 / (policy.rate * cycles):.6g} in its robot.toml",
        )
    if problems:
        raise ForeignPolicyError("; ".join(problems))
    action = _build_action_spec(policy, robot, places, cycles, np.minimum(shares, 1.0))
    return Wrapping(robot=robot, policy=policy, places=places, action=action)


def list_notes(wrapping: Wrapping) -> list[str]:
    """List what was assumed, and what differs from the training."""
    policy, robot, action = wrapping.policy, wrapping.robot, wrapping.action
    notes = [f"{name}: {text}" for name, text in policy.sources.items() if "assumed" in text]
    if commands := [term.name for term in policy.observation if term.quantity == COMMAND]:
        notes.append(f"{', '.join(commands)}: zeros")
    if share := action.gain_share:
        notes.append(f"servos have {min(share):.0%} to {max(share):.0%} of their position gain")
    if policy.damping is not None:
        own = robot.torque_speed_slope[[wrapping.places[name] for name in policy.joints]]
        notes.append(
            f"damping: {policy.damping.mean():.2g} N·m·s/rad in its training on average, the "
            f"servos have {own.mean():.2g}"
        )
    if still := [name for name in robot.joint_names if name not in action.names]:
        notes.append(f"{', '.join(still)}: no action moves them, they go to the stance")
    return notes


def _share_gains(policy: ForeignPolicy, robot: Robot, places: Mapping[str, int]) -> Array:
    """Compute the shares of the servos' position gains, (n,).

    Servos that turn two joints together keep all of theirs.
    """
    joints, shares = [places[name] for name in policy.joints], np.ones(robot.n)
    if policy.position_gain is not None:
        shares[joints] = policy.position_gain / robot.position_gain[joints]
    elif policy.p_gain is not None:
        shares[joints] = policy.p_gain / robot.p_gain[joints]
    shares[[i for coupling in robot.couplings for i in coupling.joints]] = 1.0
    return shares


def _find_gain_problems(robot: Robot, shares: Array) -> list[str]:
    own = robot.position_gain
    wrong = [
        f"'{robot.joint_names[i]}' {shares[i] * own[i]:.3g} (the servo: {own[i]:.3g})"
        for i in np.flatnonzero(~((shares > 0.0) & (shares <= 1.0 + GAIN_SLACK)))
    ]
    if not wrong:
        return []
    more = f" and {len(wrong) - MOST_NAMED} more" if len(wrong) > MOST_NAMED else ""
    return [
        f"gains [N·m/rad] of {', '.join(wrong[:MOST_NAMED])}{more}: expected above 0 and at most "
        "the servo's; p_gain in robot.toml sets that, --gain another gain"
    ]


def _build_action_spec(
    policy: ForeignPolicy, robot: Robot, places: Mapping[str, int], cycles: int, shares: Array
) -> ActionSpec:
    """Build actions that reach every angle of a joint; the network limits them further."""
    moved = [places[name] for name in policy.moved]
    reach = robot.max_velocity * robot.control_period * cycles
    spec = build_posture_spec(robot)
    return replace(
        spec,
        mode=policy.mode,
        names=tuple(robot.joint_names[i] for i in moved),
        directions=np.eye(robot.n)[moved],
        scale=spec.scale if policy.mode is ActionMode.ABSOLUTE else robot.upper - robot.lower,
        reach=SPEED_SHARE * reach,
        lead=NO_LEAD,
        homing=HOMING_SHARE * SPEED_SHARE * reach,
        cycles=cycles,
        holds=True,
        gain_share=() if np.all(shares == 1.0) else tuple(shares.tolist()),
    )
