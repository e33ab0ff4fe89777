"""Distributed training: the place of this process among all."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class DistributedProcess:
    """One process of a training, numbered by torchrun's environment variables."""

    number: int = 0
    local: int = 0
    """Number on its machine."""
    of: int = 1
    """Number of processes in the training."""

    @staticmethod
    def from_environment(environment: Mapping[str, str]) -> DistributedProcess:
        """Read torchrun's variables; without them, there is one process."""
        return DistributedProcess(
            number=int(environment.get("RANK", "0")),
            local=int(environment.get("LOCAL_RANK", "0")),
            of=int(environment.get("WORLD_SIZE", "1")),
        )

    @property
    def leads(self) -> bool:
        """Whether this process writes progress and checkpoints."""
        return self.number == 0

    def device(self, requested: str) -> str:
        """Return the device of the networks: each of several processes has its own GPU."""
        return f"cuda:{self.local}" if self.of > 1 else requested

    def seed(self, seed: int) -> int:
        """Return the seed of this process: each simulates different robots."""
        return seed + self.number
