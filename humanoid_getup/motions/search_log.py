"""Search logs: the generations of an optimization, from which it resumes.

A log keeps the costs of every generation. CMA-ES and the disturbances follow from the seed, so
feeding the costs to a new search brings it to the same state: a search that was interrupted finds
the same as one that was not, bit for bit.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from msgspec import Meta

from humanoid_getup.progress.ledger import STARTS_OVER, Ledger
from robots.quaternion import Array
from robots.storage.validation import on_axes, read_table

POPULATION = 14
"""Candidates of a generation."""


@dataclass(frozen=True, kw_only=True)
class Generation:
    """Result of one generation."""

    cost: Annotated[Array, on_axes(1)]
    """Mean cost of each candidate, (population,)."""
    stood: Annotated[float, Meta(ge=0.0, le=1.0, description="a share from 0 to 1")]
    """Share of the rollouts that succeeded."""


@dataclass(frozen=True, kw_only=True)
class SearchTask:
    """Inputs of a search."""

    robot: str
    keyframes: str
    """SHA-256 of the initial keyframes, as written."""
    seed: int
    prefer: str
    """A preference, or "keyframes"."""


class SearchLog:
    """The generations of a search, stored in a ledger."""

    def __init__(self, ledger: Ledger) -> None:
        """Read the generations of a ledger.

        Raises:
            ValueError: if one is damaged.
        """
        self._ledger = ledger
        problems: list[str] = []
        self.generations = [
            read_table(Generation, row, f"generation {name}", problems)
            for name, row in ledger.done.items()
        ]
        problems += [
            f"generation {number} has {len(each.cost)} costs, expected {POPULATION}"
            for number, each in enumerate(self.generations, start=1)
            if len(each.cost) != POPULATION and not problems
        ]
        if problems:
            raise ValueError(f"{ledger.path}: {'; '.join(problems)} ({STARTS_OVER})")

    @classmethod
    def begin(cls, path: Path, task: SearchTask) -> SearchLog:
        """Begin the log of a task; the file appears with the first generation."""
        return cls(Ledger(path, task))

    @classmethod
    def resume(cls, path: Path, task: SearchTask) -> SearchLog:
        """Load the log of a task; begin one if there is no file.

        Raises:
            ValueError: if the file is damaged, or that of another task.
        """
        return cls(Ledger.resume(path, task))

    def add(self, cost: Array, stood: float) -> None:
        """Add a generation and write the file."""
        generation = Generation(cost=cost, stood=stood)
        self.generations.append(generation)
        self._ledger.add(str(len(self.generations)), generation)
