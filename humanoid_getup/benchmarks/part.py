"""A part of a benchmark that takes long: it is run, kept and resumed as a whole."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from humanoid_getup.benchmarks.rise import Report


@dataclass(frozen=True, kw_only=True)
class Part:
    """A part of a benchmark, not yet run."""

    name: str
    """Of its file, too."""
    count: int
    """Steps that it reports."""
    depends: dict[str, Any]
    """What its result depends on."""
    run: Callable[[Report], dict[str, Any]]
    """Runs it; reports the record of each step."""
