"""Methods of getting up that a benchmark compares, made for each world and torque limit."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from humanoid_getup.motions.motion_database import MotionDatabase
from humanoid_getup.policy.onnx_policy import list_policies
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.choice import NEAREST, STRAIGHT, make_strategy
from humanoid_getup.strategies.fingerprint import compute_fingerprint
from humanoid_getup.strategies.plan import Strategy
from humanoid_getup.strategies.planned_rise import SEARCH_BUDGET, PlannedRise
from humanoid_getup.strategies.track_record import PLAN
from robots import Robot, TorqueLimit


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
    def of(
        name: str,
        database: MotionDatabase | None = None,
        fingerprint: str = "",
        search_budget: float = SEARCH_BUDGET,
        threads: int = 0,
    ) -> RiseMethod:
        """Take the strategy of a name, as `make_strategy` does."""

        def make(world: World, limit: TorqueLimit) -> Strategy:
            return make_strategy(
                world,
                name,
                torque_limit=limit,
                database=database,
                search_budget=search_budget,
                threads=threads,
            )

        is_baseline = name in (NEAREST, STRAIGHT)
        return RiseMethod(name=name, make=make, fingerprint=fingerprint, preflight=not is_baseline)


def find_policies(robot: Robot) -> dict[str, Path]:
    """Find the policies of a robot by name; none if the robot has another body."""
    if not robot.body.is_original:
        return {}
    return {file.stem: file for file in list_policies(robot)}


def list_methods(
    world: World,
    database: MotionDatabase | None,
    policies: dict[str, Path],
    search_budget: float = SEARCH_BUDGET,
    threads: int = 0,
) -> Iterator[RiseMethod]:
    """List plans and stored motions, if the robot has motions, and its policies.

    Args:
        world: Robot and scene.
        database: The robot's motions, if it has any.
        policies: Its policies, by name.
        search_budget: Of each plan, in simulated time [s].
        threads: Threads that step a plan's physics; 0 for one per processor.
    """
    if database is not None:
        planner = PlannedRise(world, database, search_budget=search_budget)
        fingerprint = compute_fingerprint(planner)
        for name in (PLAN, NEAREST):
            yield RiseMethod.of(name, database, fingerprint, search_budget, threads)
    for name, file in policies.items():
        yield RiseMethod.of(name, fingerprint=hashlib.sha256(file.read_bytes()).hexdigest())
