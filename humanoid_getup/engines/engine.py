"""An engine by its name: what runs pieces of work, with how many workers, at which address."""

from __future__ import annotations

import os
import re
from dataclasses import dataclass
from typing import Literal, Self, get_args

EngineKind = Literal["local", "ray", "dask", "slurm"]
KINDS: dict[str, EngineKind] = {kind: kind for kind in get_args(EngineKind)}
NAME = re.compile(r"([a-z]+)(?::([0-9]{1,9}))?")
EXPECTED = "local, ray, dask or slurm, with a number of workers as in local:4"
MOST_WORKERS, MOST_PROCESSES = 100_000, 256
"""Of a cluster, and of this machine."""
WITH_ADDRESS = ("ray", "dask")
"""Kinds of which a cluster may be running already."""


@dataclass(frozen=True, kw_only=True)
class Engine:
    """What runs independent pieces of work."""

    kind: EngineKind = "local"
    workers: int | None = None
    """Processes that work at the same time; None for as many as there are processors."""
    address: str = ""
    """Address of a cluster that is running; "" for one that ends with the work."""
    worth: int = 8
    """Pieces that repay the seconds in which a process of this machine starts."""

    @classmethod
    def parse(cls, name: str, address: str = "") -> Self:
        """Parse a name such as "local:4".

        Raises:
            ValueError: if there is no such engine, or it has no address.
        """
        found = NAME.fullmatch(name)
        kind = KINDS.get(found[1]) if found else None
        if found is None or kind is None:
            raise ValueError(f"engine is '{name}', expected {EXPECTED}")
        workers = None if found[2] is None else int(found[2])
        most = MOST_PROCESSES if kind == "local" else MOST_WORKERS
        if workers is not None and not 1 <= workers <= most:
            raise ValueError(f"engine is '{name}', expected 1 to {most} workers")
        if address and kind not in WITH_ADDRESS:
            raise ValueError(
                f"address is '{address}', expected none with engine {kind}: it starts its workers"
            )
        if address and workers is not None:
            raise ValueError(
                f"engine is '{name}', expected {kind} alone: the cluster at {address} has its "
                "workers"
            )
        return cls(kind=kind, workers=workers, address=address)

    def choose_workers(self, pieces: int) -> int:
        """Choose how many processes of this machine run a number of pieces.

        Without a requested number, it is that of the processors, and at most one for as many
        pieces as repay its start: a single one is this process.
        """
        if self.workers is not None:
            return min(self.workers, max(pieces, 1))
        return max(1, min(len(os.sched_getaffinity(0)), pieces // self.worth))
