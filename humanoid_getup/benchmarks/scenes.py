"""Rises in scenes: furniture, soft, slippery, sloping and rough ground; same falls for all."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from humanoid_getup.benchmarks.bench_result import CaseBench, MeasuredRise, RefusableSummary
from humanoid_getup.benchmarks.pieces import RunPieces, collect, one_by_one
from humanoid_getup.benchmarks.rise import Report, rise_from
from humanoid_getup.benchmarks.rise_method import RiseMethod
from humanoid_getup.experiments.starts.falls import CLASSES, Fall, sample_falls
from humanoid_getup.scenes.named_scenes import load_scene, seed_grounds
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.plan import Strategy
from robots import Robot, TorqueLimit

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


@dataclass(frozen=True, kw_only=True)
class ScenePiece:
    """One of many falls in a scene, from which every method rises once."""

    scene: str
    ground: int
    """Number of the ground, of those that a seed makes."""
    grounds: int
    """How many grounds there are."""
    number: int
    """Of the fall in its scene."""
    fall: Fall
    seed: int


RunScenes: TypeAlias = RunPieces[ScenePiece, list[MeasuredRise]]


def sample_scene_falls(robot: Robot, name: str, n: int, seed: int) -> Iterator[SceneFalls]:
    """Sample falls in a scene, evenly from the classes in which robots lie there.

    Where a seed makes the ground, every few falls have a ground of their own.
    """
    scene = load_scene(name, robot, seed)
    classes = list(dict.fromkeys(str(s.start_class) for s in scene.starts)) or list(CLASSES)
    grounds = seed_grounds(name, -(-n // len(classes)), seed)
    for ground, own in enumerate(grounds):
        count = n // len(grounds) + (ground < n % len(grounds))
        world = World(robot, load_scene(name, robot, own))
        each, rest = divmod(count, len(classes))
        counts = {name: each + (k < rest) for k, name in enumerate(classes)}
        falls = sample_falls(world, counts, np.random.default_rng([seed, ground]))
        yield SceneFalls(world=world, falls=tuple(falls))


def _list_pieces(robot: Robot, scene: str, each: int, seed: int) -> Iterator[ScenePiece]:
    """List the falls in a scene; they are sampled here, in their order."""
    groups, number = [*sample_scene_falls(robot, scene, each, seed)], 0
    for ground, group in enumerate(groups):
        for fall in group.falls:
            yield ScenePiece(
                scene=scene,
                ground=ground,
                grounds=len(groups),
                number=number,
                fall=fall,
                seed=seed,
            )
            number += 1


class SceneRises:
    """Rises by several methods in scenes, whose strategies it makes one scene after the other."""

    def __init__(
        self, robot: Robot, methods: Sequence[RiseMethod], torque_limit: TorqueLimit
    ) -> None:
        self._robot, self._methods, self._limit = robot, methods, torque_limit
        self._place: tuple[str, int, int] | None = None
        self._strategies: list[tuple[RiseMethod, Strategy]] = []

    @property
    def names(self) -> list[str]:
        """Return the names of the methods."""
        return [method.name for method in self._methods]

    def measure(self, piece: ScenePiece) -> list[MeasuredRise]:
        """Rise from one fall by every method."""
        self._enter(piece)
        rises = list[MeasuredRise]()
        for method, strategy in self._strategies:
            rise = rise_from(
                strategy, piece.fall, piece.number, piece.seed, preflight=method.preflight
            )
            names = {"case": piece.scene, "way": method.name}
            rises.append(MeasuredRise.refusable(rise, **names, fall=piece.number))
        return rises

    def _enter(self, piece: ScenePiece) -> None:
        """Make the strategies for the ground of a piece, unless they are made."""
        place = (piece.scene, piece.ground, piece.seed)
        if place == self._place:
            return
        own = seed_grounds(piece.scene, piece.grounds, piece.seed)[piece.ground]
        world = World(self._robot, load_scene(piece.scene, self._robot, own))
        self._strategies = [(one, one.make(world, self._limit)) for one in self._methods]
        self._place = place


def bench_scenes(
    robot: Robot,
    methods: SceneRises,
    *,
    seed: int,
    each: int,
    scenes: Sequence[str] = SCENES,
    report: Report = lambda _: None,
    run: RunScenes | None = None,
) -> CaseBench[RefusableSummary]:
    """Rise once from the same falls in every scene, by every method, on the twin.

    Args:
        robot: Robot.
        methods: Rises of this robot by the methods to compare.
        seed: Of rough ground, falls and plans.
        each: Falls in each scene.
        scenes: Names or files of scenes.
        report: Called after each rise.
        run: Does the pieces by equal methods; None: one after another, here.
    """
    pieces = {
        f"{piece.scene}: {piece.number}": piece
        for scene in scenes
        for piece in _list_pieces(robot, scene, each, seed)
    }
    run = run or one_by_one(methods.measure)
    found = collect(pieces, run, lambda rises: [report(rise) for rise in rises])
    rises = [rise for group in found.values() for rise in group]
    return CaseBench(
        name="scenes",
        seed=seed,
        n=each,
        robot=robot.name,
        cases=RefusableSummary.table(rises, scenes, methods.names),
        rises=rises,
    )
