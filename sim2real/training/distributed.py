"""Distributed training: the place of this process among all, and what they exchange."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TypeVar

Value = TypeVar("Value")


@dataclass(frozen=True, kw_only=True)
class DistributedProcess:
    """One process of a training, numbered by torchrun's environment variables."""

    number: int = 0
    local: int = 0
    """Number on its machine."""
    of: int = 1
    """Number of processes in the training."""
    beside: int = 1
    """Number of processes on its machine."""

    @staticmethod
    def from_environment(environment: Mapping[str, str]) -> DistributedProcess:
        """Read torchrun's variables; without them, there is one process."""
        return DistributedProcess(
            number=int(environment.get("RANK", "0")),
            local=int(environment.get("LOCAL_RANK", "0")),
            of=int(environment.get("WORLD_SIZE", "1")),
            beside=int(environment.get("LOCAL_WORLD_SIZE", "1")),
        )

    @property
    def leads(self) -> bool:
        """Whether this process writes progress and checkpoints."""
        return self.number == 0

    def device(self, requested: str) -> str:
        """Return the device of the networks: each of several processes has its own GPU."""
        is_gpu = requested.startswith("cuda")
        return f"cuda:{self.local}" if self.of > 1 and is_gpu else requested

    def seed(self, seed: int) -> int:
        """Return the seed of this process: each simulates different robots."""
        return seed + self.number

    def threads(self, requested: int) -> int:
        """Return the threads of its physics: by default its share of the processors."""
        if requested or self.of == 1:
            return requested
        return max(len(os.sched_getaffinity(0)) // self.beside, 1)

    def count_robots(self, robots: int) -> int:
        """Return how many of all robots this process simulates; all have equally many."""
        if robots % self.of:
            raise ValueError(
                f"the training has {robots} robots, expected a multiple of its {self.of} processes"
            )
        return robots // self.of

    @contextmanager
    def connected(self, device: str) -> Iterator[None]:
        """Connect the processes: by gloo between processors, by NCCL between GPUs."""
        if self.of == 1:
            yield
            return
        from torch import cuda, distributed

        if device.startswith("cuda"):
            if self.local >= cuda.device_count():
                raise ValueError(
                    f"{self.beside} processes train on this machine, expected at most one for each "
                    f"of its {cuda.device_count()} GPUs"
                )
            cuda.set_device(self.local)
        distributed.init_process_group("nccl" if device.startswith("cuda") else "gloo")
        try:
            yield
        finally:
            distributed.destroy_process_group()

    def lead(self, work: Callable[[], object]) -> None:
        """Do work in the first process; the others wait, and raise ValueError with its error."""
        error: Exception | None = None
        if self.leads:
            try:
                work()
            except Exception as problem:
                error = problem
        text = self.gather("" if error is None else str(error) or type(error).__name__)[0]
        if error is not None:
            raise error
        if text:
            raise ValueError(text)

    def gather(self, value: Value) -> list[Value]:
        """Return the values of all processes, in their order; each has to call this."""
        if self.of == 1:
            return [value]
        from torch import distributed

        found: list[Value] = [value] * self.of
        distributed.all_gather_object(found, value)
        return found
