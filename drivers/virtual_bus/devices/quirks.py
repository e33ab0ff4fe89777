"""Quirks: what the manual leaves open, as switches.

The e-manual tells what a healthy device does. Where it is silent, or vague, or at odds with
what users see, the virtual bus can be told what to do, so that a driver can be shown to
live with either.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from drivers.dynamixel.protocol2 import ErrorNumber


class ReadGap(Enum):
    """What the devices listed after a silent one do in a group read."""

    SLOT_STAYS_EMPTY = "each waits for its own slot, the silent one's stays empty"
    CHAIN_BREAKS = "each waits for the one before it, so all after a silent one are silent"


class BadCrc(Enum):
    """What a device does with a broken instruction."""

    SILENT = "it says nothing"
    ANSWERED = "it answers with error 3"


class WatchdogFeed(Enum):
    """What counts as traffic for a device's bus watchdog."""

    ANY_INSTRUCTION = "any instruction on the bus"
    OWN_INSTRUCTION = "instructions that concern the device"


class UndefinedRegisters(Enum):
    """What happens to addresses without an item inside a longer read or write."""

    ZEROS = "they read as zeros and writing them does nothing"
    ACCESS_ERROR = "the whole instruction fails with error 7"


@dataclass(frozen=True, kw_only=True)
class Quirks:
    """One choice for everything that the manual leaves open."""

    sync_gap: ReadGap = ReadGap.SLOT_STAYS_EMPTY
    """A dead member of a sync or bulk read. The manual shows only complete answers; it does
    not say how a device knows that its turn has come."""
    fast_gap: ReadGap = ReadGap.CHAIN_BREAKS
    """The same in a fast read, whose single frame cannot be whole any more: the manual
    does not say whether the later devices still write their pieces."""
    fast_pieces_wait: bool = False
    """Whether each device of a fast read waits its return delay before its piece. The manual
    defines the delay from instruction to answer and calls all pieces together one answer."""
    bad_crc: BadCrc = BadCrc.SILENT
    """The manual lists error 3 but a device cannot trust the id of a broken frame; silence
    is what users see."""
    strict_stuffing: bool = False
    """Whether a frame whose body holds an unstuffed FF FF FD is refused (by the wire, which
    sees the bytes). The manual demands stuffing; it does not say what happens without."""
    watchdog_feed: WatchdogFeed = WatchdogFeed.ANY_INSTRUCTION
    """The manual speaks of instruction packets without saying whose."""
    undefined: UndefinedRegisters = UndefinedRegisters.ZEROS
    """The manual gives error 7 for undefined addresses, yet its own clients read over gaps;
    an instruction that begins in one fails in either case."""
    limit_error: ErrorNumber = ErrorNumber.DATA_LIMIT
    """Number for a goal beyond a configured limit: by the manual's wording 6, but 4 (out of
    range) fits as well and is what X series are said to send."""
    torque_on_seeds_goal: bool = True
    """Whether torque on makes the present position the goal. The manual tells only that goals
    may be written before; without this, an old goal makes the servo jump."""
    locked_torque_error: ErrorNumber = ErrorNumber.NONE
    """Number for torque on after a shutdown: the manual says that only a reboot helps, not
    what the refused write is answered. With NONE the register just stays 0."""
    voltage_error_clears: bool = True
    """Whether the voltage bit goes when the voltage is good again. The manual says for none of
    the bits how they go, except by reboot."""
    reboot_time: float = 0.3
    """Silence after a reboot or power-up [s]; not in the manual."""
    ping_slot: float = 0.003
    """Time that each id has for its answer to a broadcast ping [s]; not in the manual, this
    is what the vendor's library waits per id."""
    in_position_ticks: int = 20
    """Distance at which Moving Status tells arrival; the manual gives no figure."""
    following_error_ticks: int = 100
    """Distance to the trajectory that Moving Status tells as error; no figure either."""
    overload_share: float = 0.8
    """Share of the stall current that a servo bears for ever. The manual speaks of a
    persistent load above the maximum output and gives no curve."""
    overload_time: float = 3.0
    """Time constant of the overload model [s]; not in the manual. At full stall a cold servo
    trips after about the same time."""
