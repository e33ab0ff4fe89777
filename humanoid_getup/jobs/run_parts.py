"""Runs the parts of a long benchmark; each is stored as it ends, and resumed."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

from msgspec import convert

from humanoid_getup.benchmarks.part import Part, PartResult
from humanoid_getup.engines.executor import do_pieces, is_here
from humanoid_getup.engines.versions import hash_program
from humanoid_getup.jobs.errors import refusing
from humanoid_getup.jobs.pieces.spreading import starting
from humanoid_getup.jobs.requests.bench import PARTS, BenchAll
from humanoid_getup.jobs.requests.shared import EngineOptions
from humanoid_getup.progress.callback import ProgressMonitor
from humanoid_getup.progress.ledger import Ledger

RESULT = "result"
"""Key of the result in the ledger of a part."""
Results = dict[str, PartResult]


def is_begun(request: BenchAll) -> bool:
    """Return whether there is a stored part of a benchmark."""
    return any((request.out / PARTS).glob("*.jsonl"))


def open_part(folder: Path, part: Part, *, resume: bool) -> Ledger:
    """Open the ledger of a part: the existing one to resume, else a new one.

    Raises:
        ValueError: if it is damaged, or that of another benchmark.
    """
    short = re.sub(r"[^a-z0-9]+", "_", part.name.lower()).strip("_")[:60]
    digest = hashlib.sha256(part.name.encode("utf-8", "replace")).hexdigest()[:6]
    path = folder / f"{short}_{digest}.jsonl"  # names that differ have files that differ
    recipe = {**part.depends, "program": hash_program()}
    return Ledger.resume(path, recipe) if resume else Ledger(path, recipe)


@dataclass(frozen=True, kw_only=True)
class PartWork:
    """How workers run the parts of a benchmark."""

    request: EngineOptions
    """Names the engine."""
    work: Callable[[str], PartResult]
    """Runs a part by its name."""
    robot: str


def run_parts(
    parts: Sequence[Part],
    folder: Path,
    monitor: ProgressMonitor,
    *,
    resume: bool,
    away: PartWork | None = None,
) -> Results:
    """Run the unfinished parts; every finished one is checked before any work.

    Args:
        parts: All parts.
        folder: Where each is kept.
        monitor: Shows progress, and cancels.
        resume: Whether to keep those that are finished.
        away: How workers run them; None: they run here, one after another.

    Raises:
        BadInputError: if a finished part is damaged, or of another benchmark.
        CancelledError: if it is canceled; the parts that were finished are kept.
    """
    with refusing():
        ledgers = {part.name: open_part(folder, part, resume=resume) for part in parts}
        for ledger in ledgers.values() if not resume else ():
            ledger.path.unlink(missing_ok=True)
    left = [part for part in parts if RESULT not in ledgers[part.name].done]
    if resume:
        monitor.tell(f"{len(parts) - len(left)} of {len(parts)} parts are finished")
    advance = monitor.count("rises", sum(part.count for part in left))
    counts = {part.name: part.count for part in left}

    def end(name: str, result: PartResult) -> None:
        ledgers[name].add(RESULT, result)
        advance(counts[name])

    with refusing(), ExitStack() as stack:
        executor = stack.enter_context(starting(away.request, len(left))) if away else None
        if away and executor and not is_here(executor):
            names = {name: name for name in counts}
            do_pieces(away.work, names, executor, ended=end, monitor=monitor, robot=away.robot)
        else:
            for part in left:
                run_part(part, ledgers[part.name], advance)
    return {part.name: read_result(part, ledgers[part.name]) for part in parts}


def read_result(part: Part, ledger: Ledger) -> PartResult:
    """Return the result of a finished part."""
    return convert(ledger.done[RESULT], part.kind)


def run_part(part: Part, ledger: Ledger, advance: Callable[[float], None]) -> None:
    """Run a part, and store its result."""
    steps = 0

    def report(_result: object) -> None:
        nonlocal steps
        steps += 1
        advance(1)

    ledger.add(RESULT, part.run(report))
    advance(part.count - steps)  # of classes in which the robot never lies
