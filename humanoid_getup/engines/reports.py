"""Reports of pieces while they are done: on this machine they arrive at once, elsewhere never."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from humanoid_getup.progress.callback import Progress, Report

_receive: Report = lambda _: None  # noqa: E731
"""Where the reports of this process's pieces go."""


def report(progress: Progress) -> None:
    """Report the progress of the piece that is being done."""
    _receive(progress)


def set_receiver(receive: Report) -> Report:
    """Pass the reports of this process's pieces to a function; return the one before."""
    global _receive
    before, _receive = _receive, receive
    return before


@contextmanager
def passing_reports(receive: Report) -> Iterator[None]:
    """Pass the reports of pieces that are done in this process to a function."""
    before = set_receiver(receive)
    try:
        yield
    finally:
        set_receiver(before)
