"""Search ways up a slope from falls on it, and store them in the robot's folder.

    python benchmarks/slope_ways.py --robot op3 --slope 30 --each 2 --seed 100

Rises on steep slopes begin with them. Falls are evenly of all sides; each search continues until it
finds a chain to a stand, along which the next ones may go on, or until the time is spent.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import tyro

from humanoid_getup.experiments.falls import CLASSES, Fall, sample_falls
from humanoid_getup.posture_chains.chain_search import (
    TURNS,
    ChainSearch,
    ChainTools,
    SearchSettings,
)
from humanoid_getup.posture_chains.resting_state import RestingState
from humanoid_getup.posture_chains.stored_states import find_ways, save_ways
from humanoid_getup.scenes.named_scenes import load_scene
from humanoid_getup.simulation.world import World
from robots import load_robot
from robots.kinematics import mirror_positions, place

AHEAD = 3  # rounds of which all but one are of the search that is ahead, before the first chain


def main(
    robot: str = "op3",
    slope: float = 30.0,
    each: int = 2,
    seed: int = 100,
    budget: float = 60_000.0,
    threads: int = 1,
) -> None:
    """Search and store ways up.

    Args:
        robot: Name or folder of a robot.
        slope: Angle [°].
        each: Falls on each side.
        seed: Of the falls and the search.
        budget: Simulated time after which the search ends [s].
        threads: Of the simulation.
    """
    own = load_robot(robot)
    world = World(own, load_scene(f"slope:{slope:g}", own))
    file = find_ways(world)
    if file is None:
        raise SystemExit(f"slope is {slope:g}°, expected another than 0")
    rng = np.random.default_rng(seed)
    falls = sample_falls(world, dict.fromkeys(CLASSES, each), rng)
    tools = ChainTools(world, rng, SearchSettings(threads=threads))
    searches = [ChainSearch(tools, place(own, world.model, fall.posture)) for fall in falls]
    _search(tools, searches, falls, budget)
    save_ways(file, tools.ways_up, world)
    print(f"{len(tools.ways_up)} states with a way up are in {file}")


def _search(
    tools: ChainTools, searches: Sequence[ChainSearch], falls: Sequence[Fall], budget: float
) -> None:
    turn, left = 0, list(range(len(searches)))
    for search in searches:
        search.is_hard = True
    while left and tools.player.simulated < budget:
        ahead = max(left, key=lambda k: searches[k].archive.best.progress)
        is_first = len(left) == len(searches)
        for k in [ahead] if is_first and turn % AHEAD else left:
            for _ in TURNS:
                searches[k].advance()
            if searches[k].chains:
                moves, fallen = len(searches[k].chains[0].moves), searches[k].chains[0].fallen
                print(
                    f"{falls[k].start_class}: {moves} moves, falls in {fallen} of 8 worlds, after "
                    f"{tools.player.simulated:,.0f} s simulated by all"
                )
        still = [k for k in left if not searches[k].chains]
        if len(still) < len(left):
            add_mirrored(tools)
        left, turn = still, turn + 1


def add_mirrored(tools: ChainTools) -> None:
    """File the mirror images of all states with a way up."""
    robot, model, ways = tools.world.robot, tools.world.model, tools.ways_up
    mirrored: dict[RestingState, RestingState] = {ways.goal: ways.goal}

    def mirror(state: RestingState) -> RestingState:
        if state not in mirrored:
            assert state.after is not None and state.onward is not None
            qpos = mirror_positions(robot, model, state.qpos)
            mirrored[state] = replace(
                tools.player.describe(qpos, robot.mirror_joints(state.target)),
                after=mirror(state.after),
                onward=replace(state.onward, knots=robot.mirror_joints(state.onward.knots)),
                depth=state.depth,
            )
        return mirrored[state]

    for state in list(ways):
        ways.archive.add(mirror(state))


if __name__ == "__main__":
    tyro.cli(main)
