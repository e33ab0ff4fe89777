"""A robot with a small search for motions, stored as a cancelled one is."""

from __future__ import annotations

import shutil
from pathlib import Path

from few_postures import drawing_few

from humanoid_getup.commands.motions.search_motions import MotionSearch
from humanoid_getup.posture_chains.chain_search import SearchSettings
from humanoid_getup.posture_chains.discovery import ChainDiscovery
from humanoid_getup.posture_chains.search_file import describe_search, make_recipe
from humanoid_getup.simulation.world import World
from robots import Robot
from robots.storage.arrays import save_arrays

SIDES = ("supine", "prone", "left")
SEED = 3
SMALL = SearchSettings(batch=6, threads=1)


def copy_bare_robot(robot: Robot, folder: Path) -> Path:
    """Copy a robot without motions, keys, policies and searches; return its folder."""
    hidden = shutil.ignore_patterns("motions", "policies", "keyframes.toml", "unfinished")
    return Path(shutil.copytree(robot.folder, folder / "bare", ignore=hidden))


def search_a_little(world: World) -> ChainDiscovery:
    """Search in small batches for one round."""
    with drawing_few():
        discovery = ChainDiscovery(world, seed=SEED, sides=SIDES, most=1, settings=SMALL)
    for _ in discovery.advance():
        pass
    return discovery


def store(discovery: ChainDiscovery) -> Path:
    """Store a search in the folder of its robot, as one of usual batches; return the file."""
    world = discovery.tools.world
    file = MotionSearch.file(world.robot)
    file.parent.mkdir(exist_ok=True)
    recipe = make_recipe(world, SearchSettings(), SIDES, SEED)
    save_arrays(file, describe_search(discovery, recipe))
    return file
