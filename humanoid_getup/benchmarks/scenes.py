"""Rises in scenes: furniture, soft, slippery, sloping and rough ground; same falls for all."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from humanoid_getup.benchmarks.bench_result import CaseBench, MeasuredRise, RefusableSummary
from humanoid_getup.benchmarks.rise import Report, rise_from
from humanoid_getup.benchmarks.rise_method import RiseMethod
from humanoid_getup.experiments.starts.falls import CLASSES, Fall, sample_falls
from humanoid_getup.scenes.named_scenes import load_grounds, load_scene
from humanoid_getup.simulation.world import World
from robots import FULL_TORQUE, Robot, TorqueLimit

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
class SceneFalls:
    """A world, and robots that lie in it."""

    world: World
    falls: tuple[Fall, ...]


def sample_scene_falls(robot: Robot, name: str, n: int, seed: int) -> Iterator[SceneFalls]:
    """Sample falls in a scene, evenly from the classes in which robots lie there.

    Where a seed makes the ground, every few falls have a ground of their own.
    """
    scene = load_scene(name, robot, seed)
    classes = list(dict.fromkeys(str(s.start_class) for s in scene.starts)) or list(CLASSES)
    grounds = load_grounds(name, robot, -(-n // len(classes)), seed)
    for ground, (own, _) in enumerate(grounds):
        count = n // len(grounds) + (ground < n % len(grounds))
        world = World(robot, own)
        each, rest = divmod(count, len(classes))
        counts = {name: each + (k < rest) for k, name in enumerate(classes)}
        falls = sample_falls(world, counts, np.random.default_rng([seed, ground]))
        yield SceneFalls(world=world, falls=tuple(falls))


def bench_scenes(
    robot: Robot,
    methods: Sequence[RiseMethod],
    torque_limit: TorqueLimit = FULL_TORQUE,
    *,
    seed: int,
    each: int,
    scenes: Sequence[str] = SCENES,
    report: Report = lambda _: None,
) -> CaseBench[RefusableSummary]:
    """Rise once from the same falls in every scene, by every method, on the twin.

    Args:
        robot: Robot.
        methods: Methods to compare.
        torque_limit: Of the servos.
        seed: Of rough ground, falls and plans.
        each: Falls in each scene.
        scenes: Names or files of scenes.
        report: Called after each rise.
    """
    rises = list[MeasuredRise]()
    for scene in scenes:
        number = 0
        for group in sample_scene_falls(robot, scene, each, seed):
            strategies = [(one, one.make(group.world, torque_limit)) for one in methods]
            for fall in group.falls:
                for method, strategy in strategies:
                    rise = rise_from(strategy, fall, number, seed, preflight=method.preflight)
                    way = method.name
                    rises.append(MeasuredRise.refusable(rise, case=scene, way=way, fall=number))
                    report(rises[-1])
                number += 1
    return CaseBench(
        name="scenes",
        seed=seed,
        n=each,
        robot=robot.name,
        cases=RefusableSummary.table(rises, scenes, [method.name for method in methods]),
        rises=rises,
    )
