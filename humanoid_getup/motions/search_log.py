"""Search logs: what an optimization found so far, so that it can go on where it was interrupted.

A log keeps the costs of every generation. CMA-ES and the disturbances follow from the seed, so
feeding the costs to a new search brings it to the same state: a search that was interrupted finds
the same as one that was not, bit for bit.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Annotated

from msgspec import Meta

from robots.files import write_atomically
from robots.quaternion import Array
from robots.validation import on_axes, parse_file, read_table

POPULATION = 14
"""Candidates of a generation."""


@dataclass(frozen=True, kw_only=True)
class Generation:
    """Result of one generation."""

    cost: Annotated[Array, on_axes(1)]
    """Mean cost of each candidate, (population,)."""
    stood: Annotated[float, Meta(ge=0.0, le=1.0, description="a share from 0 to 1")]
    """Share of the rollouts that ended as they should."""


@dataclass(frozen=True, kw_only=True)
class SearchTask:
    """What a search depends on."""

    robot: str
    keyframes: str
    """SHA-256 of those it begins with, as they are written."""
    seed: Annotated[int, Meta(ge=0, le=2**32)]
    prefer: str
    """A preference, or "keyframes"."""


@dataclass(frozen=True, kw_only=True)
class _File:
    task: SearchTask
    generations: tuple[Generation, ...]


@dataclass
class SearchLog:
    """The generations of a search, kept in a file."""

    path: Path
    task: SearchTask
    generations: list[Generation] = field(default_factory=list)

    @classmethod
    def resume(cls, path: Path, task: SearchTask) -> SearchLog:
        """Load the log of a task; begin one where there is no file.

        Raises:
            ValueError: if the file is damaged, or that of another task.
        """
        if not path.exists():
            return cls(path, task)
        problems: list[str] = []
        try:
            content = parse_file(path, "JSON", json.loads)
        except ValueError as error:
            raise ValueError(f"{path}: {error}") from error
        file = read_table(_File, content if isinstance(content, dict) else {}, "", problems)
        problems += [
            f"generation {number} has {len(each.cost)} costs, expected {POPULATION}"
            for number, each in enumerate(file.generations, start=1)
            if len(each.cost) != POPULATION and not problems
        ]
        if problems:
            raise ValueError(f"{path}: {'; '.join(problems)} (without --resume it starts over)")
        mine, other = asdict(task), asdict(file.task)
        if changed := [key for key in mine if mine[key] != other[key]]:
            raise ValueError(
                f"{path}: made with another {', '.join(changed)}, expected the same "
                "(without --resume it starts over)"
            )
        return cls(path, task, list(file.generations))

    def add(self, cost: Array, stood: float) -> None:
        """Add a generation and write the file."""
        self.generations.append(Generation(cost=cost, stood=stood))
        rows = [{"cost": each.cost.tolist(), "stood": each.stood} for each in self.generations]
        record = {"task": asdict(self.task), "generations": rows}
        self.path.parent.mkdir(parents=True, exist_ok=True)
        write_atomically(self.path, json.dumps(record, indent=1) + "\n")
