"""An engine by its name: what does pieces of work, with how many workers, at which address."""

from __future__ import annotations

import os
import re
from dataclasses import dataclass
from typing import Literal, Self, get_args

EngineKind = Literal["local", "dask", "slurm"]
KINDS: dict[str, EngineKind] = {kind: kind for kind in get_args(EngineKind)}
NAME = re.compile(r"([a-z]+)(?::([0-9]{1,9}))?")
EXPECTED = "local, dask or slurm, with a number of workers as in local:4"
MOST_WORKERS, MOST_PROCESSES = 100_000, 256
"""Of a cluster, and of this machine."""
TRIES = 3  # of a piece whose worker ends
LOST = (
    f"a worker ended in each of {TRIES} tries of a piece, expected one that lasts: use fewer "
    "if memory ran out, or engine local:1 to see what happens, and resume"
)
WORTH = 8
"""Fewest pieces for which a worker process pays off."""


@dataclass(frozen=True, kw_only=True)
class Engine:
    """What does independent pieces of work."""

    kind: EngineKind = "local"
    workers: int | None = None
    """Processes that work at the same time; None for as many as there are processors."""
    address: str = ""
    """Address of a running Dask scheduler; "" for a cluster that ends with the work."""

    @classmethod
    def parse(cls, name: str, address: str = "") -> Self:
        """Parse a name such as "local:4"; raise an error if there is no such engine."""
        found = NAME.fullmatch(name)
        kind = KINDS.get(found[1]) if found else None
        if found is None or kind is None:
            raise ValueError(f"engine is '{name}', expected {EXPECTED}")
        workers = None if found[2] is None else int(found[2])
        most = MOST_PROCESSES if kind == "local" else MOST_WORKERS
        if workers is not None and not 1 <= workers <= most:
            raise ValueError(f"engine is '{name}', expected 1 to {most} workers")
        if address and kind != "dask":
            raise ValueError(
                f"address is '{address}', expected none with engine {kind}: it starts its workers"
            )
        if address and workers is not None:
            raise ValueError(
                f"engine is '{name}', expected dask alone: the cluster at {address} has its workers"
            )
        return cls(kind=kind, workers=workers, address=address)

    def choose_workers(self, pieces: int, worth: int = WORTH) -> int:
        """Choose the number of processes for some pieces; a single one is this process.

        Without a requested number it is that of the processors, and at most one for each ``worth``
        pieces.
        """
        if self.workers is not None:
            return min(self.workers, max(pieces, 1))
        return max(1, min(len(os.sched_getaffinity(0)), pieces // worth))
