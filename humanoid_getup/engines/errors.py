"""Errors of engines."""

from __future__ import annotations


class EngineError(ValueError):
    """An engine cannot be used, or a worker cannot do what it is for; the message says what to do.

    Pieces that were finished before are kept by their ledger.
    """


class WorkerLostError(EngineError):
    """A piece ended its worker each time that it was tried."""

    def __init__(self, tries: int, reason: str) -> None:
        super().__init__(
            f"a worker ended in each of {tries} tries of a piece ({reason}), expected one that "
            "lasts: use fewer if memory ran out, or engine local:1 to see what happens, and resume"
        )


class VersionError(EngineError):
    """A worker has another version of what results depend on."""
