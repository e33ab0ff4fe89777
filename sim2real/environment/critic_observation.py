"""The critic's observation: the policy's observation and privileged state."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from humanoid_getup.policy.observation import ROTATION, VECTOR, Floats, MirrorPart
from humanoid_getup.simulation.domain_parameters import DomainParameters
from robots import Robot
from sim2real.environment.privileged_state import PrivilegedState
from sim2real.environment.randomization import MOST_DELAY


@dataclass(frozen=True, kw_only=True, eq=False)
class CriticInputs:
    """Quantities that critic terms are computed from, for N robots."""

    state: PrivilegedState
    parameters: DomainParameters
    held: NDArray[np.floating[Any]]
    """Time of uninterrupted standing [s], (N,)."""


@dataclass(frozen=True, eq=False)
class CriticTerm:
    """A named part of the critic's observation, with its mirror image."""

    name: str
    read: Callable[[CriticInputs], NDArray[Any]]
    """Computes the values, (N, size) or (N,)."""
    mirror: MirrorPart


def list_critic_terms(robot: Robot) -> tuple[CriticTerm, ...]:
    """List the terms that follow the policy's observation, in order."""
    size = robot.standing_neck_height
    soles = len(robot.sole_sites)
    same = (np.arange(1), np.ones(1))
    swapped = (np.arange(soles)[::-1], np.ones(soles))
    joints = (robot.mirror_index, robot.mirror_sign)
    return (
        CriticTerm("neck_height", lambda k: k.state.stance.neck_height / size, same),
        CriticTerm("sole_height", lambda k: k.state.sole_height / size, swapped),
        CriticTerm("sole_distance", lambda k: k.state.sole_distance / size, same),
        CriticTerm("upright", lambda k: k.state.upright, same),
        CriticTerm("non_foot_contact", lambda k: k.state.stance.non_foot_contact, same),
        CriticTerm("velocity", lambda k: k.state.root_vel[:, :3], VECTOR),
        CriticTerm("angular_velocity", lambda k: k.state.root_vel[:, 3:], ROTATION),
        CriticTerm("torque", lambda k: k.state.torque / robot.max_torque, joints),
        CriticTerm("friction", lambda k: k.parameters.friction, same),
        CriticTerm("voltage", lambda k: k.parameters.voltage / robot.supply_voltage, same),
        CriticTerm("mass", lambda k: k.parameters.mass.mean(axis=1), same),
        CriticTerm("action_delay", lambda k: k.parameters.action_delay / MOST_DELAY, same),
        CriticTerm("sensor_delay", lambda k: k.parameters.sensor_delay / MOST_DELAY, same),
        CriticTerm("held", lambda k: k.held, same),
    )


def observe_privileged(
    terms: Sequence[CriticTerm], observation: Floats, inputs: CriticInputs
) -> Floats:
    """Concatenate the policy's observation and each term, (N, size)."""
    n = len(observation)
    read = (term.read(inputs).reshape(n, -1) for term in terms)
    return np.concatenate((observation, *read), axis=1, dtype=np.float32, casting="same_kind")
