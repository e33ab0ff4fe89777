"""What has passed over a virtual wire."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass
class WireStatistics:
    """Counts since the bus began; each is a number of its kind, bytes where it says so."""

    bytes_in: int = 0
    """Bytes that clients sent."""
    bytes_out: int = 0
    """Bytes that clients were handed."""
    packets: int = 0
    """Instructions whose CRC matched when they left the client."""
    answers: int = 0
    """Answers that devices gave; each device's part of a fast answer is one."""
    damaged: int = 0
    """Instructions whose CRC did not match when they left the client."""
    noise: int = 0
    """Bytes from clients that belong to no instruction."""
    broken_off: int = 0
    """Instructions dropped for a gap between two of their bytes."""
    wrong_baud: int = 0
    """Instructions that no device heard, for the client's rate is none of theirs."""
    unstuffed: int = 0
    """Instructions that hold FF FF FD and miss the FD after it."""
    talked_over: int = 0
    """Instructions sent while devices still answered the one before."""
    unanswered: int = 0
    """Instructions that ask for an answer and got none."""
    overflow: int = 0
    """Bytes lost because the client did not read."""
    sendings: int = 0
    """Times that bytes were handed over on time's account (real time only)."""
    lateness_total: float = 0.0
    """How much later than the wire would all these were [s]."""
    lateness_max: float = 0.0
    """How much later the latest was [s]."""

    @property
    def lateness_mean(self) -> float:
        """Return how much later than the wire the client had its bytes, on average [s]."""
        return self.lateness_total / self.sendings if self.sendings else 0.0
