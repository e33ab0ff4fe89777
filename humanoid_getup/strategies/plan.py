"""Rise plans: the answer to how a robot gets up from where it lies."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum
from typing import Protocol

import numpy as np

from humanoid_getup.motions.motion import Motion
from humanoid_getup.motions.motion_database import Connection
from robots import FULL_TORQUE, Posture, TorqueLimit


class RiseStatus(Enum):
    """How the planning of a rise ended."""

    STOOD = "a rehearsal ends in a held stand"
    NOT_PLANNED = "no path to any connecting posture"
    FELL = "no rehearsal ends in a held stand"
    UNREHEARSED = "planned, but not filtered"
    LEARNED = "a policy decides on the way"


@dataclass(frozen=True, kw_only=True)
class RiseOptions:
    """Which halves of the method to use, and within what."""

    planning: bool = True
    """False: straight interpolation to the connecting posture."""
    filtering: bool = True
    """False: the smoothed path and the motion are handed out as they are."""
    assistance: float = 1.0
    """Share of the virtual actuator's torques that the filter uses."""
    torque_limit: TorqueLimit = FULL_TORQUE


@dataclass(frozen=True, kw_only=True)
class RisePlan:
    """The answer to how a robot gets up from where it lies."""

    status: RiseStatus
    reason: str
    motion: Motion | None = None
    """From the lying posture to the stand, ready to be played."""
    connection: Connection | None = None
    planned: bool = False
    """Whether a path to a connecting posture was found."""
    stand_time: float = math.nan
    """Start to held stand in the rehearsal [s]; nan without one."""
    robust: float = math.nan
    """Share of the disturbed rehearsals that stood; nan without any."""
    rehearsals: int = 0
    rounds: int = 0
    plan_s: float = 0.0
    """Wall time of selecting, planning and smoothing the first round's paths [s]."""
    filter_s: float = 0.0
    """Wall time of everything after it [s]."""

    @property
    def title(self) -> str:
        """Name what is to be played; empty where there is nothing."""
        return self.motion.name if self.motion else ""


class Strategy(Protocol):
    """Finds a motion or a policy that gets the robot up from where it lies."""

    def plan(self, start: Posture, rng: np.random.Generator, /) -> RisePlan:
        """Plan a rise from a posture at rest."""
        ...
