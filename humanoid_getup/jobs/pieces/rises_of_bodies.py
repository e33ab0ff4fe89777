"""Rises of the bodies of others, as parts: a worker has the files of a body at the same paths."""

from __future__ import annotations

import platform
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from pathlib import Path
from typing import Self

import mujoco

from humanoid_getup.benchmarks.bodies.body_bench import BenchedBody, NoMotions
from humanoid_getup.benchmarks.bodies.body_starts import BodyStarts, find_columns, hash_file
from humanoid_getup.benchmarks.bodies.head_gauge import HeadGauge
from humanoid_getup.benchmarks.bodies.published_body import FEET, HEAD, PublishedBody
from humanoid_getup.benchmarks.part import Part, PartResult
from humanoid_getup.benchmarks.rise_method import RiseMethod, find_policies, list_methods
from humanoid_getup.engines.versions import hash_folder
from humanoid_getup.jobs.errors import BadInputError, refusing
from humanoid_getup.jobs.import_robot import read_source
from humanoid_getup.jobs.requests.bench import STARTS, BenchBodies
from humanoid_getup.jobs.run_parts import PartWork
from humanoid_getup.motions.motion_database import list_motions, load_database
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.choice import NEAREST
from humanoid_getup.strategies.track_record import PLAN
from robots import load_robot


@dataclass(frozen=True, kw_only=True)
class BodyFiles:
    """The files of a body that its rises depend on."""

    model: Path
    starts: Path
    """Start states, converted."""
    robot: Path
    """Folder."""

    @classmethod
    def of(cls, request: BenchBodies, body: PublishedBody) -> Self:
        """Return where the files of a body are, or will be."""
        return cls(
            model=body.find_model(request.folder),
            starts=request.out / STARTS / f"{body.name}.npz",
            robot=request.robots_folder / body.name,
        )

    def hash(self) -> dict[Path, str]:
        """Compute their checksums; "" for one that is missing."""
        return {
            self.model: hash_file(self.model) if self.model.is_file() else "",
            self.starts: hash_file(self.starts) if self.starts.is_file() else "",
            self.robot: hash_folder(self.robot) if self.robot.is_dir() else "",
        }


@dataclass(frozen=True, kw_only=True)
class SharedBody:
    """A body as workers get it."""

    published: PublishedBody
    checksums: tuple[str, ...]
    """Of its files."""

    @classmethod
    def find(cls, request: BenchBodies, body: PublishedBody) -> Self:
        """Find the checksums of a body that was read."""
        return cls(published=body, checksums=tuple(BodyFiles.of(request, body).hash().values()))

    def check(self, request: BenchBodies) -> None:
        """Compare its files with those of this process.

        Raises:
            BadInputError: naming a file that is missing, or another one.
        """
        found = BodyFiles.of(request, self.published).hash()
        for (path, checksum), expected in zip(found.items(), self.checksums, strict=True):
            if checksum != expected:
                raise BadInputError(
                    f"{path} is {'another one' if checksum else 'missing'} on {platform.node()}, "
                    "expected that with which the benchmark began: share its folder, or copy it to "
                    "the same path"
                )


def load_body(
    request: BenchBodies,
    body: PublishedBody,
    source: mujoco.MjModel,
    starts: BodyStarts,
    threads: int = 0,
) -> BenchedBody:
    """Load the robot of a body, and find what it can do.

    Args:
        request: Folders and numbers.
        body: The body.
        source: Its makers' model.
        starts: Its makers' start states.
        threads: Threads that step the physics of plans; 0 for one per processor.

    Raises:
        BadInputError: if the robot does not fit model or start states.
    """
    with refusing():
        robot = load_robot(BodyFiles.of(request, body).robot)
        find_columns(starts.joints, robot)
        world = World(robot)
        gauge = HeadGauge(source, world.model, head=HEAD, feet=FEET, standing=body.head_height)
        return BenchedBody(
            published=body,
            world=world,
            starts=starts,
            gauge=gauge,
            methods=[*_list_methods(world, request.search_budget, threads)],
            search_budget=request.search_budget,
            seed=request.seed,
            each=request.n,
            count=request.starts,
        )


def _list_methods(world: World, search_budget: float, threads: int) -> Iterator[RiseMethod]:
    """List plans, which find nothing without motions, and policies."""
    database = load_database(world.robot) if list_motions(world.robot) else None
    if database is None:
        yield RiseMethod(
            name=PLAN,
            make=lambda place, limit: NoMotions(world=place, torque_limit=limit),
            fingerprint="no motions",
        )
    policies = find_policies(world.robot)
    for method in list_methods(world, database, policies, search_budget, threads):
        if method.name != NEAREST:
            yield method


def spread_bodies(request: BenchBodies, bodies: Sequence[PublishedBody]) -> PartWork:
    """Describe how workers run the parts of bodies that were read and imported."""
    shared = BenchBodies(
        folder=request.folder.resolve(),
        robots=request.robots_folder.resolve(),
        out=request.out.resolve(),
        n=request.n,
        starts=request.starts,
        seed=request.seed,
        search_budget=request.search_budget,
    )
    found = tuple(SharedBody.find(shared, body) for body in bodies)
    # The robots are compared body by body, by those that need them: there is no single one.
    return PartWork(request=request, work=partial(rise_on_body, shared, found), robot="")


def rise_on_body(request: BenchBodies, bodies: Sequence[SharedBody], name: str) -> PartResult:
    """Run a part by its name, in a worker, which loads the body of that part alone.

    Raises:
        BadInputError: if a file of that body is missing there, or another one.
    """
    body = next(body for body in bodies if name.startswith(f"{body.published.name}: "))
    return _load_parts(request, body)[name].run(lambda _: None)


@lru_cache(maxsize=1)
def _load_parts(request: BenchBodies, body: SharedBody) -> dict[str, Part]:
    """Load the parts of a body, in a worker, once."""
    body.check(request)
    files = BodyFiles.of(request, body.published)
    with refusing():
        source, starts = read_source(files.model), BodyStarts.load(files.starts)
    loaded = load_body(request, body.published, source, starts, threads=1)
    return {part.name: part for part in loaded.parts()}
