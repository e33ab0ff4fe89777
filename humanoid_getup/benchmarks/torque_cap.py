"""Torque caps of a benchmark: shares of the stall torque of a robot's own servos."""

from __future__ import annotations

from dataclasses import dataclass

from robots import Robot, TorqueLimit
from robots.servo import LimitMode

# Of OP3's 4.1 N·m they are 3.0, 2.5 and 2.0 N·m, the limits of the other benchmarks.
SHARES = (1.0, 0.73, 0.61, 0.49)
QUICK_SHARES = (1.0, 0.61)


@dataclass(frozen=True, kw_only=True)
class TorqueCap:
    """A torque limit on every servo, as a share of the strongest one's stall torque."""

    share: float
    limit: TorqueLimit

    @property
    def name(self) -> str:
        """Return its name in tables."""
        return "stall torque" if self.limit.value is None else f"{self.share:.0%}"


def make_caps(
    robot: Robot, by: LimitMode | None = None, shares: tuple[float, ...] = SHARES
) -> list[TorqueCap]:
    """Make the caps of a robot, rounded to three digits.

    Raises:
        ValueError: if its servos do not limit torque in that way, or not so low.
    """
    stall = float(robot.max_torque.max())
    values = [None if share == 1.0 else float(f"{share * stall:.3g}") for share in shares]
    return [
        TorqueCap(share=share, limit=TorqueLimit(value, by).on(robot))
        for share, value in zip(shares, values, strict=True)
    ]
