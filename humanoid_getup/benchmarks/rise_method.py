"""Methods of getting up that a benchmark compares, made for each world and torque limit."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from humanoid_getup.motions.motion_database import MotionDatabase
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.choice import NEAREST, STRAIGHT, make_strategy
from humanoid_getup.strategies.plan import Strategy
from robots import TorqueLimit


@dataclass(frozen=True, kw_only=True)
class RiseMethod:
    """A way to get up."""

    name: str
    make: Callable[[World, TorqueLimit], Strategy]
    fingerprint: str = ""
    """Checksum of its inputs besides the world; "" if no result of it is stored."""
    preflight: bool = True
    """Whether the preflight may refuse it; False for baselines, to see whether they stand."""

    @staticmethod
    def of(name: str, database: MotionDatabase | None = None, fingerprint: str = "") -> RiseMethod:
        """Take the strategy of a name, as `make_strategy` does."""

        def make(world: World, limit: TorqueLimit) -> Strategy:
            return make_strategy(world, name, torque_limit=limit, database=database)

        is_baseline = name in (NEAREST, STRAIGHT)
        return RiseMethod(name=name, make=make, fingerprint=fingerprint, preflight=not is_baseline)
