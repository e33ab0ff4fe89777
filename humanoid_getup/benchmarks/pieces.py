"""Independent pieces of a benchmark: done one after another here, or anywhere in any order."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TypeAlias, TypeVar

Piece = TypeVar("Piece")
Result = TypeVar("Result")

RunPieces: TypeAlias = Callable[[Mapping[str, Piece], Callable[[str, Result], None]], None]
"""Does pieces, by name, anywhere and in any order; hands each result over as it ends."""


def one_by_one(work: Callable[[Piece], Result]) -> RunPieces[Piece, Result]:
    """Do pieces one after another in this process."""

    def run(pieces: Mapping[str, Piece], end: Callable[[str, Result], None]) -> None:
        for name, piece in pieces.items():
            end(name, work(piece))

    return run


def collect(
    pieces: Mapping[str, Piece],
    run: RunPieces[Piece, Result],
    report: Callable[[Result], object] = lambda _: None,
) -> dict[str, Result]:
    """Do pieces; report each result as it ends, and return all, in the order of the pieces."""
    results = dict[str, Result]()

    def end(name: str, result: Result) -> None:
        results[name] = result
        report(result)

    run(pieces, end)
    return {name: results[name] for name in pieces}
