"""Get up in every scene by plans, policies, stored motions and straight interpolation.

Furniture, soft, slippery, sloping and rough ground; the same falls for all ways, evenly of the ways
in which robots lie in a scene. Where a seed makes the ground, every few falls have their own.

    python benchmarks/rise_in_scenes.py --n 20 --seed 11 --json scenes.json
    python benchmarks/rise_in_scenes.py --scenes flat --ways plan --body arms=1.6
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache, partial

import numpy as np
import tyro
from script import (
    RISE_FIGURES,
    LimitedOptions,
    RefusableRise,
    RefusableSummary,
    do_pieces,
    write_results,
)

from humanoid_getup.benchmarks.rise import RisePiece, rise_from
from humanoid_getup.experiments.falls import CLASSES, Fall, sample_falls
from humanoid_getup.motions.motion_database import load_database
from humanoid_getup.planning.planner_settings import PlannerSettings
from humanoid_getup.scenes.named_scenes import load_scene, seed_grounds
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.choice import NEAREST, STRAIGHT, make_strategy
from humanoid_getup.strategies.plan import Strategy
from robots import Robot

SCENES = (
    "flat",
    "beam",
    "low-bed-a",
    "low-bed-b",
    "soft-bed",
    "table",
    "wall",
    "ice",
    "slope:5",
    "slope:10",
    "slope:15",
    "rough:easy",
    "rough:medium",
    "rough:hard",
)


@dataclass(frozen=True, kw_only=True)
class SceneOptions(LimitedOptions):
    """Options of this script."""

    n: int = 20
    """Falls in each scene."""
    scenes: tuple[str, ...] = SCENES
    """Names or files of scenes."""
    ways: tuple[str, ...] = ("plan", "robust", NEAREST, STRAIGHT)
    """plan; nearest: the stored motion nearest to the start; straight: straight interpolation to
    a stored motion, unfiltered; and policies by name or file."""


@dataclass(frozen=True, kw_only=True)
class SceneFall:
    """A robot that lies in a scene."""

    scene: str
    ground: int
    """Seed of the ground."""
    number: int
    """Of the fall in its scene."""
    fall: Fall


def main(options: SceneOptions) -> None:
    """Measure, and write the figures of every way in every scene."""
    robot = options.load_robot()
    pieces = [
        piece
        for scene in options.scenes
        for piece in list_scene_falls(robot, scene, options.n, options.seed)
    ]
    groups = do_pieces(partial(rise_in_scene, options), pieces, options)
    rises = [rise for group in groups for rise in group]
    cases = RefusableSummary.table(rises, options.scenes, options.ways)
    result = options.describe("scenes", options.n) | {"cases": cases, "rises": rises}
    write_results(result, (*RISE_FIGURES, "refused"), options.json)


def list_scene_falls(robot: Robot, name: str, n: int, seed: int) -> Iterator[SceneFall]:
    """Sample falls in a scene, evenly from the classes in which robots lie there."""
    scene = load_scene(name, robot, seed)
    classes = list(dict.fromkeys(str(s.start_class) for s in scene.starts)) or list(CLASSES)
    grounds = seed_grounds(name, -(-n // len(classes)), seed)
    number = 0
    for k, ground in enumerate(grounds):
        each, rest = divmod(n // len(grounds) + (k < n % len(grounds)), len(classes))
        counts = {side: each + (j < rest) for j, side in enumerate(classes)}
        world = World(robot, load_scene(name, robot, ground))
        for fall in sample_falls(world, counts, np.random.default_rng([seed, k])):
            yield SceneFall(scene=name, ground=ground, number=number, fall=fall)
            number += 1


def rise_in_scene(options: SceneOptions, piece: SceneFall) -> list[RefusableRise]:
    """Rise from one fall in every way."""
    rises, number = list[RefusableRise](), piece.number
    for way, strategy in make_strategies(options, piece.scene, piece.ground).items():
        again = RisePiece(
            number=number,
            fall=piece.fall,
            bench_class=piece.scene,
            seed=options.seed,
            preflight=way not in (NEAREST, STRAIGHT),
        )
        rise = rise_from(strategy, again)
        rises.append(RefusableRise.of(rise, case=piece.scene, way=way, fall=number))
    return rises


@lru_cache(maxsize=1)
def make_strategies(options: SceneOptions, scene: str, ground: int) -> dict[str, Strategy]:
    """Make the strategies for a ground, by the names of the ways."""
    robot = options.load_robot()
    world, database = World(robot, load_scene(scene, robot, ground)), load_database(robot)
    limit = options.make_limit(robot)
    settings = PlannerSettings(torque_limit=limit, threads=options.threads)
    return {way: make_strategy(world, way, settings, database=database) for way in options.ways}


if __name__ == "__main__":
    main(tyro.cli(SceneOptions, description=__doc__))
