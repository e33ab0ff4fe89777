"""Methods of getting up that a benchmark compares, made for each torque limit."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from humanoid_getup.strategies.plan import Strategy
from robots import TorqueLimit


@dataclass(frozen=True, kw_only=True)
class RiseMethod:
    """A way to get up."""

    name: str
    make: Callable[[TorqueLimit], Strategy]
    fingerprint: str
    """Checksum of its inputs, besides the world."""
    preflight: bool = True
    """Whether the preflight may refuse it; False for stored motions, which are always played."""
