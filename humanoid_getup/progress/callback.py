"""Callbacks of long work: one reports progress, one requests cancellation."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

Cancel = Callable[[], bool]
"""Returns whether to cancel the work, such as the `is_set` of an event."""


@dataclass(frozen=True, kw_only=True)
class Progress:
    """Progress of a phase of some work, or a finding."""

    phase: str = ""
    """Name of the phase, such as "rises (supine)"."""
    done: float = 0.0
    """Number of finished pieces."""
    total: float | None = None
    """Number of all pieces; None for a phase whose pieces are not counted."""
    note: str = ""
    """Remark on the last piece."""
    message: str = ""
    """A finding to show on a line of its own; the other fields are empty then."""

    def __str__(self) -> str:
        """Write it in one line."""
        if self.message:
            return self.message
        counted = "" if self.total is None else f" {self.done:.0f} of {self.total:.0f}"
        return f"{self.phase}{counted}{f', {self.note}' if self.note else ''}"


Report = Callable[[Progress], None]
"""Shows progress."""


class CancelledError(Exception):
    """Work was canceled by its caller; finished parts are kept."""


class ProgressMonitor:
    """Reports the progress of some work, and ends it between two pieces if it is canceled."""

    def __init__(self, report: Report | None = None, cancel: Cancel | None = None) -> None:
        """Prepare to report progress to ``report`` and to call ``cancel``, if given."""
        self._report = report or (lambda _: None)
        self.cancel = cancel or (lambda: False)

    def check(self) -> None:
        """Raise `CancelledError` if the work is canceled."""
        if self.cancel():
            raise CancelledError("cancelled")

    def commit(self) -> None:
        """Ignore cancellation from now on: what was done cannot be undone."""
        self.cancel = lambda: False

    def show(self, progress: Progress) -> None:
        """Report progress, and raise `CancelledError` if the work is canceled."""
        self._report(progress)
        self.check()

    def begin(self, phase: str) -> None:
        """Report a phase whose pieces are not counted."""
        self.show(Progress(phase=phase))

    def tell(self, message: str) -> None:
        """Report a finding."""
        self.show(Progress(message=message))

    def count(self, phase: str, total: float) -> Callable[[float], None]:
        """Report a phase whose pieces are counted; return what advances it."""
        done = 0.0

        def advance(pieces: float) -> None:
            nonlocal done
            done += pieces
            self.show(Progress(phase=phase, done=done, total=total))

        advance(0.0)
        return advance
