"""Choices for device behavior that the e-manual leaves open.

Where the manual is silent, vague or contradicted by users' experience, the virtual devices can
be configured either way, so that a driver can be tested against both.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from drivers.dynamixel.protocol2 import ErrorNumber


class ReadGap(Enum):
    """Behavior of the devices listed after a silent one in a group read."""

    SLOT_STAYS_EMPTY = "each waits for its own slot, the silent one's stays empty"
    CHAIN_BREAKS = "each waits for the one before it, so all after a silent one are silent"


class BadCrc(Enum):
    """Reaction of a device to an instruction with a wrong CRC."""

    SILENT = "no reply"
    ANSWERED = "a reply with error 3"


class WatchdogFeed(Enum):
    """Traffic that resets the bus watchdog of a device."""

    ANY_INSTRUCTION = "any instruction on the bus"
    OWN_INSTRUCTION = "instructions that concern the device"


class UndefinedRegisters(Enum):
    """Treatment of addresses without an item inside a longer read or write."""

    ZEROS = "they read as zeros and writing them does nothing"
    ACCESS_ERROR = "the whole instruction fails with error 7"


@dataclass(frozen=True, kw_only=True)
class Quirks:
    """One choice for each point that the manual leaves open."""

    sync_gap: ReadGap = ReadGap.SLOT_STAYS_EMPTY
    """A silent member of a sync or bulk read. The manual shows complete replies only and does not
    say how a device recognizes its turn."""
    fast_gap: ReadGap = ReadGap.CHAIN_BREAKS
    """The same in a fast read, whose single frame is incomplete then: the manual does not say
    whether later devices still send their pieces."""
    fast_pieces_wait: bool = False
    """Whether each device of a fast read waits its return delay before its piece. The manual
    defines the delay from instruction to reply and calls all pieces together one reply."""
    bad_crc: BadCrc = BadCrc.SILENT
    """The manual lists error 3, but a device cannot trust the id of a damaged frame; users
    observe silence."""
    strict_stuffing: bool = False
    """Whether an instruction that contains an unstuffed FF FF FD is ignored. The manual requires
    byte stuffing and does not say what happens without."""
    watchdog_feed: WatchdogFeed = WatchdogFeed.ANY_INSTRUCTION
    """The manual says "instruction packets" without saying addressed to which device."""
    undefined: UndefinedRegisters = UndefinedRegisters.ZEROS
    """The manual gives error 7 for undefined addresses, yet its own clients read across gaps.
    An instruction that begins in a gap fails in either case."""
    limit_error: ErrorNumber = ErrorNumber.DATA_LIMIT
    """Error for a goal beyond a configured limit: 6 by the manual's wording, though X series
    reportedly send 4 (out of range)."""
    torque_on_seeds_goal: bool = True
    """Whether torque on sets the goal to the present position. The manual only says that goals
    may be written before; without this, an old goal makes the servo jump."""
    locked_torque_error: ErrorNumber = ErrorNumber.NONE
    """Error for torque on after a shutdown: the manual says that only a reboot helps, not how the
    write is answered. With NONE the register stays 0 without an error."""
    goal_switches_torque_on: bool = True
    """Whether a servo without drive modes (AX, MX(1.0), XL-320, Feetech) switches torque on when
    a goal is written; users report that of AX and Feetech's, and no manual says it."""
    voltage_error_clears: bool = True
    """Whether the voltage bit is cleared when the voltage is back in range. The manual mentions
    no other way to clear error bits than a reboot."""
    reboot_time: float = 0.3
    """Silence after a reboot or power-up [s]; not in the manual."""
    ping_slot: float = 0.003
    """Time slot of each id for its reply to a broadcast ping [s]; not in the manual, this is the
    time that the vendor's library waits per id."""
    in_position_ticks: int = 20
    """Distance at which Moving Status reports arrival; the manual gives no figure."""
    following_error_ticks: int = 100
    """Distance to the trajectory that Moving Status reports as following error; no figure."""
    overload_share: float = 0.8
    """Share of the stall current that a servo sustains indefinitely. The manual mentions a
    persistent load above the maximum output and gives no curve."""
    overload_time: float = 3.0
    """Time constant of the overload model [s]; not in the manual. At full stall a cold servo
    trips after about the same time."""
