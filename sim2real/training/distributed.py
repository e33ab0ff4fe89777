"""Ranks: which of several processes that train together this one is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class DistributedProcess:
    """One process of a training; torchrun tells each its place by its environment."""

    number: int = 0
    local: int = 0
    """Its number on its own machine."""
    of: int = 1
    """How many train together."""

    @staticmethod
    def from_environment(environment: Mapping[str, str]) -> DistributedProcess:
        """Read what torchrun says; alone without it."""
        return DistributedProcess(
            number=int(environment.get("RANK", "0")),
            local=int(environment.get("LOCAL_RANK", "0")),
            of=int(environment.get("WORLD_SIZE", "1")),
        )

    @property
    def leads(self) -> bool:
        """Tell whether this process writes progress and checkpoints."""
        return self.number == 0

    def device(self, asked: str) -> str:
        """Return the device to learn on: of several processes, each has a GPU of its own."""
        return f"cuda:{self.local}" if self.of > 1 else asked

    def seed(self, seed: int) -> int:
        """Return the seed of this process: each has robots of its own."""
        return seed + self.number
