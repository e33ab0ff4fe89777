"""Workers of an engine."""

from __future__ import annotations

from concurrent.futures import Executor
from dataclasses import dataclass, field
from queue import SimpleQueue

from humanoid_getup.progress.callback import Progress


@dataclass(frozen=True, kw_only=True)
class Workers:
    """Workers of an engine, and what gives them pieces."""

    executor: Executor
    count: int
    """How many pieces they do at the same time; 0 for the process that submits them."""
    reports: SimpleQueue[Progress] = field(default_factory=SimpleQueue)
    """Progress of pieces that processes of this machine do."""
