"""Choices for device behavior that the e-manual leaves open.

Where the manual is silent, vague or contradicted by users' experience, the virtual devices can
be configured either way, so that a driver can be tested against both.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class ReadGap(Enum):
    """Behavior of the devices listed after a silent one in a group read."""

    SLOT_STAYS_EMPTY = "each waits for its own slot, the silent one's stays empty"
    CHAIN_BREAKS = "each waits for the one before it, so all after a silent one are silent"


@dataclass(frozen=True, kw_only=True)
class Quirks:
    """One choice for each point that the manual leaves open."""

    sync_gap: ReadGap = ReadGap.SLOT_STAYS_EMPTY
    """A silent member of a sync or bulk read. The manual shows complete replies only and does not
    say how a device recognizes its turn."""
    fast_gap: ReadGap = ReadGap.CHAIN_BREAKS
    """The same in a fast read, whose single frame is incomplete then: the manual does not say
    whether later devices still send their pieces."""
    goal_switches_torque_on: bool = True
    """Whether a servo without drive modes (AX, MX(1.0), XL-320, Feetech) switches torque on when
    a goal is written; users report that of AX and Feetech's, and no manual says it."""
    reboot_time: float = 0.3
    """Silence after a reboot or power-up [s]; not in the manual."""
