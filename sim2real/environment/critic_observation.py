"""What critics see besides the observation: what only a simulation knows."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from humanoid_getup.policy.observation import ROTATION, VECTOR, Floats, MirrorPart
from robots import Robot
from sim2real.environment.conditions import Conditions
from sim2real.environment.privileged_state import PrivilegedState
from sim2real.environment.randomization import MOST_DELAY


@dataclass(frozen=True, kw_only=True, eq=False)
class Known:
    """What a simulation knows of N robots."""

    truth: PrivilegedState
    conditions: Conditions
    held: NDArray[np.floating[Any]]
    """How long each has stood [s], (N,)."""


@dataclass(frozen=True, eq=False)
class CriticTerm:
    """A named part of what critics see, and how left and right are exchanged in it."""

    name: str
    read: Callable[[Known], NDArray[Any]]
    """Its numbers, (N, size), or (N,) where it has one."""
    mirror: MirrorPart


def list_critic_terms(robot: Robot) -> tuple[CriticTerm, ...]:
    """List the parts of what critics see besides the observation, in their order."""
    size = robot.standing_neck_height
    soles = len(robot.sole_sites)
    same = (np.arange(1), np.ones(1))
    swapped = (np.arange(soles)[::-1], np.ones(soles))
    joints = (robot.mirror_index, robot.mirror_sign)
    return (
        CriticTerm("neck_height", lambda k: k.truth.neck_height / size, same),
        CriticTerm("sole_height", lambda k: k.truth.sole_height / size, swapped),
        CriticTerm("sole_distance", lambda k: k.truth.sole_distance / size, same),
        CriticTerm("upright", lambda k: k.truth.upright, same),
        CriticTerm("foreign", lambda k: k.truth.foreign, same),
        CriticTerm("velocity", lambda k: k.truth.root_vel[:, :3], VECTOR),
        CriticTerm("angular_velocity", lambda k: k.truth.root_vel[:, 3:], ROTATION),
        CriticTerm("torque", lambda k: k.truth.torque / robot.max_torque, joints),
        CriticTerm("friction", lambda k: k.conditions.friction, same),
        CriticTerm("voltage", lambda k: k.conditions.voltage / robot.supply_voltage, same),
        CriticTerm("mass", lambda k: k.conditions.mass.mean(axis=1), same),
        CriticTerm("action_delay", lambda k: k.conditions.action_delay / MOST_DELAY, same),
        CriticTerm("sensor_delay", lambda k: k.conditions.sensor_delay / MOST_DELAY, same),
        CriticTerm("held", lambda k: k.held, same),
    )


def observe_privileged(terms: Sequence[CriticTerm], observation: Floats, known: Known) -> Floats:
    """Put together what critics see: the observation, then each term, (N, size)."""
    n = len(observation)
    read = (term.read(known).reshape(n, -1) for term in terms)
    return np.concatenate((observation, *read), axis=1, dtype=np.float32, casting="same_kind")
