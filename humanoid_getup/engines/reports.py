"""Reports of pieces while they are done: on this machine they arrive at once, elsewhere never."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from humanoid_getup.progress.callback import Progress, Report


def ignore(_progress: Progress) -> None:
    """Ignore a report."""


_heard: Report = ignore
"""Where the reports of this process's pieces go."""


def report(progress: Progress) -> None:
    """Report the progress of the piece that is being done."""
    _heard(progress)


@contextmanager
def hearing(heard: Report) -> Iterator[None]:
    """Pass the reports of pieces that are done in this process to a function."""
    global _heard
    before, _heard = _heard, heard
    try:
        yield
    finally:
        _heard = before
