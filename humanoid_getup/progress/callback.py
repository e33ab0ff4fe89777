"""Callbacks of long work: one reports progress, one says whether to cancel."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Progress:
    """How far a phase of some work has come, or what was found on the way."""

    phase: str = ""
    """What is being done, such as "rises (supine)"."""
    done: float = 0.0
    """Pieces that are finished."""
    total: float | None = None
    """All pieces; None for a phase whose pieces are not counted."""
    note: str = ""
    """What is known of the last piece."""
    message: str = ""
    """A finding that is worth a line of its own; the other fields are empty then."""


Report = Callable[[Progress], None]
"""Shows progress."""
Cancel = Callable[[], bool]
"""Tells whether work is to end before it is finished, such as the `is_set` of an event."""


class CancelledError(Exception):
    """Work ended because its caller no longer wanted it; what was finished is kept."""


class ProgressMonitor:
    """Reports the progress of some work, and ends it between two pieces once it is cancelled."""

    def __init__(self, report: Report | None = None, cancel: Cancel | None = None) -> None:
        """Watch work that shows its progress to ``report`` and asks ``cancel``, if there are."""
        self._report = report or (lambda _: None)
        self._cancel = cancel or (lambda: False)

    def check(self) -> None:
        """Do nothing, unless the work is cancelled.

        Raises:
            CancelledError: if it is.
        """
        if self._cancel():
            raise CancelledError("cancelled")

    def show(self, progress: Progress) -> None:
        """Report progress, and end the work if it is cancelled (`CancelledError`)."""
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
