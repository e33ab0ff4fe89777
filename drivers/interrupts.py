"""Interrupts: signals that must not cut off the release of a robot."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

SIGNALS = ("SIGINT", "SIGTERM", "SIGHUP", "SIGTSTP")


@contextmanager
def deferred_interrupts() -> Iterator[None]:
    """Let a block run to its end; a signal that arrives meanwhile is handled after it.

    Only the main thread receives signals; in others nothing changes.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    caught: list[tuple[Callable[[int, FrameType | None], object], int, FrameType | None]] = []
    handlers = {}
    for name in SIGNALS:
        number = getattr(signal, name)
        handler = signal.getsignal(number)
        if not callable(handler):  # ignored, or the system's own
            continue
        handlers[number] = handler
        signal.signal(number, lambda n, frame, h=handler: caught.append((h, n, frame)))
    try:
        yield
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
    if caught:
        handle, number, frame = caught[0]
        handle(number, frame)


@contextmanager
def unsuspended() -> Iterator[None]:
    """End a block at Ctrl-Z (SIGTSTP) as at Ctrl-C: a suspended program commands no robot."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def end(_number: int, frame: FrameType | None) -> None:
        handle = signal.getsignal(signal.SIGINT)
        if callable(handle):
            handle(signal.SIGINT, frame)
        raise KeyboardInterrupt  # where Ctrl-C is ignored, as in the background

    before = signal.signal(signal.SIGTSTP, end)
    try:
        yield
    finally:
        signal.signal(signal.SIGTSTP, before or signal.SIG_DFL)
