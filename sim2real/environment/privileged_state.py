"""Privileged state: quantities of the simulation for rewards and critic."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from humanoid_getup.experiments.disturbances import MOST_DELAY
from humanoid_getup.policy.observation import ROTATION, SAME, VECTOR, Floats, Mirror
from humanoid_getup.simulation.domain_parameters import DomainParameters
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


def observe_privileged(
    terms: Sequence[CriticTerm],
    observation: Floats,
    state: PrivilegedState,
    parameters: DomainParameters,
    held: NDArray[np.floating[Any]],
) -> Floats:
    """Concatenate the policy's observation, each term and the time of standing [s], (N, size)."""
    n = len(observation)
    parts = (*(term.read(state, parameters) for term in terms), held)
    columns = (part.reshape(n, -1) for part in parts)
    return np.concatenate((observation, *columns), axis=1, dtype=np.float32, casting="same_kind")
