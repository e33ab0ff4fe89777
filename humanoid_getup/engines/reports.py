"""Reports of pieces while they are done: on this machine they arrive at once, elsewhere never."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from humanoid_getup.progress.callback import Progress, Report


def ignore(_progress: Progress) -> None:
    """Ignore a report."""


_receive: Report = ignore
"""Where the reports of this process's pieces go."""


def report(progress: Progress) -> None:
    """Report the progress of the piece that is being done."""
    _receive(progress)


@contextmanager
def passing_reports(receive: Report) -> Iterator[None]:
    """Pass the reports of pieces that are done in this process to a function."""
    global _receive
    before, _receive = _receive, receive
    try:
        yield
    finally:
        _receive = before
