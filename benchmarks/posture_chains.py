"""Measure how long the search for posture chains takes until a robot stands up.

    python benchmarks/posture_chains.py --robot op3 --side supine --seeds 1,2,3,4,5,6,7,8

The first chain of each seed is replayed in the robot's own physics steps, without feedback, in
disturbed worlds.
"""

from __future__ import annotations

import time
from pathlib import Path
from statistics import median

import msgspec
import numpy as np
import tyro

from humanoid_getup.experiments.disturbances.disturbance import USUAL
from humanoid_getup.experiments.judging.outcome import Outcome
from humanoid_getup.experiments.judging.standing import HOLD_TIME
from humanoid_getup.experiments.judging.summary import wilson_interval
from humanoid_getup.experiments.rollouts.play import Experiment
from humanoid_getup.experiments.starts.falls import CLASSES
from humanoid_getup.motions.build import lay_down
from humanoid_getup.motions.motion import hold_last
from humanoid_getup.posture_chains.chain_search import ChainSearch, ChainTools, SearchSettings
from humanoid_getup.simulation.world import World
from robots import load_robot
from robots.storage.encoding import to_json

WORLDS = 17  # in which a chain is replayed, the first undisturbed


class FoundChain(msgspec.Struct, frozen=True, kw_only=True):
    """The search of one seed, and the replays of its first chain."""

    seed: int
    stood: bool
    """Whether it found a chain that stands in all the worlds of the search."""
    simulated_s: float
    processor_s: float
    progress: float
    """Of the state that is nearest to a stand; that of the stance is 1."""
    moves: int = 0
    replayed: bool = False
    """Whether the chain stands undisturbed."""
    disturbed: int = 0
    """Disturbed worlds in which it stands."""


def main(
    robot: str = "op3",
    side: str = "supine",
    seeds: tuple[int, ...] = (1, 2, 3, 4, 5, 6, 7, 8),
    cap: float = 8000.0,
    json: Path | None = None,
) -> None:
    """Search from a side with each seed, on one thread, and print a row of a table for each.

    Args:
        robot: Name or folder of a robot.
        side: Side on which it lies, with its joints as in the stance.
        seeds: Of the search.
        cap: Simulated time after which a search ends [s].
        json: File for the results.
    """
    if side not in CLASSES:
        raise SystemExit(f"--side is '{side}', expected one of {', '.join(CLASSES)}")
    world = World(load_robot(robot))
    found = [_search(world, side, seed, cap) for seed in seeds]
    stood = [each for each in found if each.stood]
    low, high = wilson_interval(len(stood), len(found))
    print(f"stood {len(stood)} of {len(found)} ({low:.0%} to {high:.0%})")
    if stood:
        print(f"median of those {median(each.simulated_s for each in stood):.0f} s simulated")
    if json is not None:
        json.write_text(to_json({"robot": robot, "side": side, "cap_s": cap, "seeds": found}))


def _search(world: World, side: str, seed: int, cap: float) -> FoundChain:
    lying = lay_down(world, side, world.robot.standing.joint_pos)
    began = time.process_time()
    tools = ChainTools(world, np.random.default_rng(seed), SearchSettings(threads=1))
    search = ChainSearch(tools, lying)
    while not search.chains and tools.player.simulated < cap:
        search.advance()
    found = FoundChain(
        seed=seed,
        stood=bool(search.chains),
        simulated_s=tools.player.simulated,
        processor_s=time.process_time() - began,
        progress=search.archive.best.progress,
    )
    if search.chains:
        chain = search.chains[0]
        sent = chain.sample(world.robot.control_period, tools.player.rest)
        stood = _replay(world, lying, sent)
        found = msgspec.structs.replace(
            found,
            moves=len(chain.moves),
            replayed=bool(stood[0]),
            disturbed=int(stood[1:].sum()),
        )
    print(f"| {' | '.join(map(_show, msgspec.structs.astuple(found)))} |", flush=True)
    return found


def _replay(world: World, lying: np.ndarray, sent: np.ndarray) -> np.ndarray:
    """Replay targets (T, n) in all worlds; return where they end in a held stand, (WORLDS,)."""
    held = hold_last(sent, len(sent) + round((HOLD_TIME + 0.5) / world.robot.control_period))
    scenarios = USUAL.sample(world, lying, WORLDS, np.random.default_rng(1))
    record = Experiment(world, threads=1).play(scenarios, [held] * WORLDS, stop_early=True)
    return Outcome(record, world.robot).stood


def _show(value: object) -> str:
    return f"{value:.2f}" if isinstance(value, float) else str(value)


if __name__ == "__main__":
    tyro.cli(main)
