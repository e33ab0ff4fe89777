"""Measures the bodies of others: imports them, converts their start states, and writes one page."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Sequence
from pathlib import Path

import mujoco

from humanoid_getup.benchmarks.bodies.body_bench import BenchedBody, BodyBench, summarize_bodies
from humanoid_getup.benchmarks.bodies.body_starts import BodyStarts, hash_file
from humanoid_getup.benchmarks.bodies.published_body import PUBLISHED, REPOSITORY, PublishedBody
from humanoid_getup.benchmarks.rise_method import find_policies
from humanoid_getup.jobs.errors import BadInputError, refusing
from humanoid_getup.jobs.import_robot import import_robot, read_source
from humanoid_getup.jobs.output_files import staging
from humanoid_getup.jobs.pieces.rises_of_bodies import (
    BodyFiles,
    load_body,
    spread_bodies,
)
from humanoid_getup.jobs.requests.bench import (
    BODIES_ARTEFACTS,
    BODIES_FIGURES,
    BODIES_PAGE,
    PARTS,
    BenchBodies,
)
from humanoid_getup.jobs.requests.robots import ImportRequest
from humanoid_getup.jobs.requests.values import name_choices
from humanoid_getup.jobs.run_parts import run_parts
from humanoid_getup.motions.motion_database import list_motions, suggest_motions
from humanoid_getup.progress.callback import Cancel, ProgressMonitor, Report
from humanoid_getup.reporting.bodies_page import write_bodies_page
from robots.storage.encoding import to_json
from robots.storage.files import write_atomically


def measure_bodies(
    request: BenchBodies,
    report: Report | None = None,
    cancel: Cancel | None = None,
    published: tuple[PublishedBody, ...] = PUBLISHED,
) -> BodyBench:
    """Run or resume the benchmark over bodies; write its page; return its figures.

    All files of all bodies are read before any rise, and every problem is told at once.

    Args:
        request: Folder, bodies and numbers.
        report: Shows progress.
        cancel: Tells whether to end.
        published: Bodies to choose among.

    Raises:
        BadInputError: if a body's files cannot be used, or finished parts are of another benchmark.
        CancelledError: if ``cancel`` ended it; the parts that were finished are kept.
    """
    BenchBodies.accept(request)
    monitor = ProgressMonitor(report, cancel)
    chosen = _choose(request, published)
    sources = _read_all(request, chosen, monitor)
    bodies = []
    for body, (source, starts) in zip(chosen, sources, strict=True):
        monitor.begin(f"loading {body.name}")
        bodies.append(_load_body(request, body, source, starts))
    parts = [part for body in bodies for part in body.parts()]
    away = spread_bodies(request, chosen)
    results = run_parts(parts, request.out / PARTS, monitor, resume=request.resume, away=away)
    notes, command = [*_list_notes(bodies)], _write_command(request)
    result = summarize_bodies(bodies, results, notes=notes, command=command)
    with staging(request.out, BODIES_ARTEFACTS) as folder:
        write_atomically(folder / BODIES_FIGURES, to_json(result))
        write_atomically(folder / BODIES_PAGE, write_bodies_page(result))
    return result


def _choose(
    request: BenchBodies, published: tuple[PublishedBody, ...]
) -> tuple[PublishedBody, ...]:
    """Choose the requested bodies, and check that their files are there."""
    known = {body.name: body for body in published}
    if unknown := [name for name in request.bodies if name not in known]:
        raise BadInputError(
            *(f"--bodies is '{each}', expected {name_choices([*known])}" for each in unknown)
        )
    chosen = tuple(known[name] for name in request.bodies) or published
    files = [find for body in chosen for find in _list_files(request.folder, body)]
    if missing := [file for file in files if not file.is_file()]:
        if len(missing) == len(files):
            raise BadInputError(f"{request.folder}: no copy of {REPOSITORY}: expected {missing[0]}")
        raise BadInputError(
            *(f"{file}: no such file, expected it as in {REPOSITORY}" for file in missing)
        )
    return chosen


def _list_files(folder: Path, body: PublishedBody) -> tuple[Path, Path]:
    return body.find_model(folder), body.find_starts(folder)


def _read_all(
    request: BenchBodies, chosen: tuple[PublishedBody, ...], monitor: ProgressMonitor
) -> list[tuple[mujoco.MjModel, BodyStarts]]:
    """Read models and start states; tell all that cannot be read."""
    found, problems = [], list[str]()
    for body in chosen:
        monitor.begin(f"reading {body.name}")
        try:
            with refusing():
                source = read_source(body.find_model(request.folder))
                found.append((source, _read_starts(request, body, source)))
        except BadInputError as error:
            problems += error.problems
    if problems:
        raise BadInputError(*problems)
    return found


def _read_starts(request: BenchBodies, body: PublishedBody, source: mujoco.MjModel) -> BodyStarts:
    """Read converted start states; convert them if that was not done, or from another file."""
    pickled = body.find_starts(request.folder)
    converted = BodyFiles.of(request, body).starts
    if converted.is_file():
        starts = BodyStarts.load(converted)
        if (starts.body, starts.source_sha256) == (body.name, hash_file(pickled)):
            return starts
    starts = BodyStarts.convert(body.name, pickled, source)
    converted.parent.mkdir(parents=True, exist_ok=True)
    starts.save(converted)
    return starts


def _load_body(
    request: BenchBodies, body: PublishedBody, source: mujoco.MjModel, starts: BodyStarts
) -> BenchedBody:
    """Load a body's robot, imported first if there is none."""
    files = BodyFiles.of(request, body)
    if not (files.robot / "robot.toml").exists():
        import_robot(ImportRequest(model=files.model, out=files.robot))
    return load_body(request, body, source, starts)


def _list_notes(bodies: Sequence[BenchedBody]) -> Iterator[str]:
    """List what bodies lack, with the command that makes it."""
    robots = {body.name: body.world.robot for body in bodies}
    if bare := [name for name, robot in robots.items() if not list_motions(robot)]:
        yield (
            f"Without motions, and so without a plan that stands: {', '.join(bare)}. For the "
            f"first, make some by {suggest_motions(robots[bare[0]])}."
        )
    if bare := [name for name, robot in robots.items() if not find_policies(robot)]:
        yield f"Without a policy, and so with nothing learned: {', '.join(bare)}."


def _write_command(request: BenchBodies) -> str:
    """Write the command line that repeats the benchmark."""
    words = ["getup", "bench", "bodies", str(request.folder)]
    words += ["--bodies", ",".join(request.bodies)] if request.bodies else []
    words += ["--robots", str(request.robots)] if request.robots else []
    words += ["--n", str(request.n), "--starts", str(request.starts), "--seed", str(request.seed)]
    words += ["--search-budget", f"{request.search_budget:g}"]
    return shlex.join(words)
