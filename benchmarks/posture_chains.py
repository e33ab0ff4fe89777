"""Measure how long the search for motions takes from each side of a robot.

    python benchmarks/posture_chains.py --robot op3 --seeds 1 2 3

First from how many of the robot's balanced squats it rises with shares of its torque; then a row
for each side and seed: what was simulated until it had a motion, and that motion. With a budget of
0 only the first.
"""

from __future__ import annotations

import time
from pathlib import Path

import msgspec
import numpy as np
import tyro

from humanoid_getup.posture_chains.chain_search import SearchSettings
from humanoid_getup.posture_chains.discovery import ChainDiscovery, SideSearch
from humanoid_getup.posture_chains.motion_maker import SHARES, MadeMotion
from humanoid_getup.posture_chains.moves import RandomMoves
from humanoid_getup.posture_chains.ways_up import find_rises
from humanoid_getup.simulation.world import World
from robots import FULL_TORQUE, load_robot
from robots.storage.encoding import to_json


class SideRow(msgspec.Struct, frozen=True, kw_only=True):
    """The search from one side with one seed."""

    seed: int
    side: str
    simulated_s: float
    """By all sides together, when this one had its motion, or at the end."""
    processor_s: float
    share: float = 0.0
    """Of the 48 rollouts that judge a motion; 0 without one."""
    stand_time_s: float = float("nan")
    keys: int = 0
    strategy: str = ""


def main(
    robot: str = "op3",
    seeds: tuple[int, ...] = (1, 2, 3),
    budget: float = 100_000.0,
    threads: int = 1,
    json: Path | None = None,
) -> None:
    """Search one motion from each side with each seed, and print a row of a table for each.

    Args:
        robot: Name or folder of a robot.
        seeds: Of the search.
        budget: Simulated time after which a search ends [s].
        threads: Of the simulation.
        json: File for the results.
    """
    world = World(load_robot(robot))
    _show_squats(world)
    rows = [row for seed in seeds if budget for row in _search(world, seed, budget, threads)]
    found = [row for row in rows if row.share > 0.0]
    if budget:
        print(f"{len(found)} of {len(rows)} sides have a motion")
    if json is not None:
        json.write_text(to_json({"robot": robot, "budget_s": budget, "rows": rows}))


def _show_squats(world: World) -> None:
    """Print from how many squats a robot rises with shares of its torque."""
    moves = RandomMoves(world.robot, np.random.default_rng(0))
    for share in sorted((1.0, *SHARES), reverse=True):
        rises = find_rises(world, moves, FULL_TORQUE, share)
        print(f"with {share:.0%} of its torque it rises from {rises.sum()} of {len(rises)} squats")


def _search(world: World, seed: int, budget: float, threads: int) -> list[SideRow]:
    begun = time.process_time()
    settings = SearchSettings(threads=threads)
    discovery = ChainDiscovery(world, seed=seed, most=1, settings=settings)
    rows: dict[str, SideRow] = {}

    def add(each: SideSearch, made: MadeMotion | None) -> None:
        row = SideRow(
            seed=seed,
            side=each.side,
            simulated_s=discovery.simulated,
            processor_s=time.process_time() - begun,
        )
        if made is not None and made.motion is not None:
            row = msgspec.structs.replace(
                row,
                share=made.share,
                stand_time_s=made.motion.stand_time or np.nan,
                keys=len(made.keyframes.keys),
                strategy=made.motion.strategy,
            )
        rows[each.side] = row
        print(f"| {' | '.join(map(_show, msgspec.structs.astuple(row)))} |", flush=True)

    while not discovery.is_done and discovery.simulated < budget:
        for each, made in discovery.advance():
            if made.motion is not None:
                add(each, made)
    for each in discovery.sides:
        if each.side not in rows:
            add(each, None)
    return [*rows.values()]


def _show(value: object) -> str:
    return f"{value:.2f}" if isinstance(value, float) else str(value)


if __name__ == "__main__":
    tyro.cli(main)
