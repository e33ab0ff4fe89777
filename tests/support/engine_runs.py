"""Runs pieces on an engine in tests."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from humanoid_getup.engines.engine import Engine
from humanoid_getup.engines.run_pieces import run_pieces, start_workers


def run(engine: str, work: Callable[[Any], int], pieces: list[Any]) -> list[int]:
    """Run pieces; return their results in the order of the pieces."""
    done = dict[str, int]()
    with start_workers(Engine.parse(engine), len(pieces)) as workers:
        named = {str(number): piece for number, piece in enumerate(pieces)}
        run_pieces(work, named, workers, done.__setitem__)
    return [done[name] for name in named]
