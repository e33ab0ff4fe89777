"""What is validated of a servo, each under its own name, after moteus's hardware validations."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum


class Check(Enum):
    """What a servo must do to be valid."""

    FOLLOWS = "follows a slow ramp"
    HOLDS = "holds against its load"
    VELOCITY_LIMIT = "velocity limit"
    WRAPAROUND = "wraparound is refused"
    STAYS_WITHIN = "stays within range"
    TORQUE_LIMIT = "torque limit is kept"
    WATCHDOG = "watchdog stops it"
    TORQUE_OFF = "torque off on close"
    REPLY_TIME = "reply time"


@dataclass(frozen=True, kw_only=True)
class Validation:
    """Result of one check of a servo."""

    check: Check
    measured: float | None
    """None where it could not be measured."""
    limit: float
    """Largest value that passes, in the same unit."""
    unit: str
    remark: str = ""
    """What was measured, or why it was not."""
    applies: bool = True
    """False where a servo of this kind has nothing to check."""

    @property
    def passed(self) -> bool | None:
        """Return whether the value was measured and is within its limit; None if none applies."""
        if not self.applies:
            return None
        return self.measured is not None and self.measured <= self.limit


def find_failed(validations: Iterable[Validation]) -> list[Check]:
    """Find the checks that failed."""
    return [validation.check for validation in validations if validation.passed is False]
