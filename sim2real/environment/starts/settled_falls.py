"""Initial states of training episodes: robots that fell limp, and lie still."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from humanoid_getup.experiments.starts.drop import Drops, FallError
from humanoid_getup.scenes.start_region import StartRegion
from humanoid_getup.simulation.world import World
from robots.kinematics import mirror_positions
from robots.quaternion import Array
from sim2real.environment.starts.motion_frames import LEVELS, list_backward_starts
from sim2real.environment.starts.start_pool import StartPool
from sim2real.environment.starts.terrain import Terrain

# rad/s and m/s; with coarse physics steps a robot at rest moves at up to 0.03; rolling and
# sliding are faster.
SETTLED_SPEED = 0.5
MOST_ROUNDS = 50  # batches to drop for each that would do if every robot settled
POOL_SEED = 7_001  # makes the falls of training differ from those of evaluation
BATCH = 512  # robots that are dropped together


def make_pool(world: World, count: int, rng: np.random.Generator) -> StartPool:
    """Make a pool of ``count`` settled falls and their mirror images."""
    drops = Drops(world, min(count, BATCH))
    falls = drop_falls(drops, count, rng)
    return StartPool.of(np.concatenate([falls, mirror_positions(world.robot, world.model, falls)]))


def make_backward_pool(world: World, count: int, rng: np.random.Generator) -> StartPool:
    """Make a pool of frames of the robot's rises, the last ones easiest, and of settled falls.

    Raises:
        ValueError: if the robot has no motion that rises.
    """
    frames, levels = list_backward_starts(world.robot, world.model)
    falls = make_pool(world, count, rng).qpos
    fallen = np.repeat([False, True], [len(frames), len(falls)])
    level = np.concatenate([levels, np.full(len(falls), LEVELS)])
    return StartPool.of(np.concatenate([frames, falls]), level, fallen)


def make_terrain_pool(
    world: World, terrain: Terrain, count: int, rng: np.random.Generator
) -> StartPool:
    """Make a pool of settled falls on each patch of a terrain, the world's scene.

    There are ``count`` on each of two patches of a level, and twice as many if it has only one.
    """
    falls, levels = [], []
    drops = Drops(world, min(count, BATCH))
    for patch in terrain.patches:
        beside = sum(other.level == patch.level for other in terrain.patches)
        falls.append(drop_falls(drops, 2 * count // beside, rng, (patch.region,)))
        levels.append(np.full(len(falls[-1]), patch.level))
    return StartPool.of(np.concatenate(falls), np.concatenate(levels))


def pool_rng(seed: int) -> np.random.Generator:
    """Make the random source of a training's falls, which differs from every evaluation's.

    Evaluations draw from ``default_rng(seed)``, which differs for every seed below 2**32.
    """
    return np.random.default_rng([seed, POOL_SEED])


def drop_falls(
    drops: Drops, count: int, rng: np.random.Generator, regions: Sequence[StartRegion] = ()
) -> Array:
    """Drop robots with torque off in random postures until ``count`` have settled, (count, nq).

    They fall in some regions of the scene; what rolls out of all of them is left out.

    Raises:
        FallError: if too few settle.
    """
    found: list[Array] = []
    rounds = MOST_ROUNDS * math.ceil(count / drops.count)
    for _ in range(rounds):
        qpos, settled = drops.drop(SETTLED_SPEED, rng, regions=regions)
        if regions:
            root = drops.world.robot.layout(drops.world.model).root_position
            inside = [any(region.spans(row[root]) for region in regions) for row in qpos]
            settled &= np.array(inside)
        found.append(qpos[settled])
        if sum(map(len, found)) >= count:
            return np.concatenate(found)[:count]
    raise FallError(
        f"robot '{drops.world.robot.name}' does not come to rest: {sum(map(len, found))} of "
        f"{rounds * drops.count} falls settled, expected {count}"
    )
