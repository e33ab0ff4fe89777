"""Phases of getting up and of the stand, as they are reported."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class Phase(Enum):
    """What an attempt is doing."""

    SETTLING = "waiting until the robot is still"
    PLANNING = "planning"
    PREFLIGHT = "preflight"
    PLAYING = "playing"
    HOLDING = "holding the stand"
    FOLLOWING = "following its pilot"
    LYING_DOWN = "sitting and lying down"
    RECOVERING = "recovering"
    ENDED = "ended"


@dataclass(frozen=True)
class PhaseChange:
    """The start of a phase."""

    phase: Phase
    attempt: int
    """From 1."""
    detail: str
