"""Runs the parts of a long benchmark; each is stored as it ends, and resumed."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable, Sequence
from pathlib import Path

from msgspec import convert

from humanoid_getup.benchmarks.part import Part, PartResult
from humanoid_getup.jobs.errors import refusing
from humanoid_getup.jobs.requests.bench import PARTS, BenchAll, BenchBodies
from humanoid_getup.progress.callback import ProgressMonitor
from humanoid_getup.progress.ledger import Ledger

RESULT = "result"
"""Key of the result in the ledger of a part."""
Results = dict[str, PartResult]
SpreadParts = Callable[[Sequence[str], Callable[[str, PartResult], None]], bool]
"""Runs parts by name with workers, and hands each result over as it ends; returns whether it did:
False if there is no worker but this process."""


def is_begun(request: BenchAll | BenchBodies) -> bool:
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
    return Ledger.resume(path, part.depends) if resume else Ledger(path, part.depends)


def run_parts(
    parts: Sequence[Part],
    folder: Path,
    monitor: ProgressMonitor,
    *,
    resume: bool,
    spread: SpreadParts | None = None,
) -> Results:
    """Run the unfinished parts; every finished one is checked before any work.

    Args:
        parts: All parts.
        folder: Where each is kept.
        monitor: Shows progress, and cancels.
        resume: Whether to keep those that are finished.
        spread: Runs parts by name, in any order; None: one after another, here.

    Raises:
        BadInputError: if a finished part is damaged, or of another benchmark.
        CancelledError: if it is canceled; the parts that were finished are kept.
    """
    if not resume:
        for path in folder.glob("*.jsonl"):
            path.unlink()
    with refusing():
        ledgers = {part.name: open_part(folder, part, resume=resume) for part in parts}
    left = [part for part in parts if RESULT not in ledgers[part.name].done]
    if resume:
        monitor.tell(f"{len(parts) - len(left)} of {len(parts)} parts are finished")
    advance = monitor.count("rises", sum(part.count for part in left))
    if spread is not None:
        counts = {part.name: part.count for part in left}

        def end(name: str, result: PartResult) -> None:
            ledgers[name].add(RESULT, result)
            advance(counts[name])

        with refusing():
            left = left if not spread([*counts], end) else []
    for part in left:
        with refusing():
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
