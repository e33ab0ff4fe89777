"""The real-time class of the system's scheduler, for threads that must not wait behind others."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager

LOOP_PRIORITY = 50  # as that of other robots' control loops
WIRE_PRIORITY = 60  # of virtual servos: real ones wait for no processor
IS_KNOWN = hasattr(os, "SCHED_RESET_ON_FORK")  # on Linux
USUAL = (os.SCHED_OTHER, os.SCHED_BATCH, os.SCHED_IDLE) if IS_KNOWN else ()


@contextmanager
def in_real_time_class(priority: int = LOOP_PRIORITY) -> Iterator[bool]:
    """Put this thread into the real-time class (SCHED_FIFO) while the block runs.

    It then runs as soon as it wakes, before all threads of other classes. Threads and processes
    that it starts stay outside. Yields whether the thread is in the class; without permission, or
    on a system without such a class, it stays where it is.
    """
    before = _find_class()
    try:
        yield enter_real_time_class(priority)
    finally:
        if before is not None and before in USUAL and _find_class() not in (*USUAL, None):
            # Without privileges, the flag that leaves its children outside cannot be taken back.
            os.sched_setscheduler(0, before | os.SCHED_RESET_ON_FORK, os.sched_param(0))


def enter_real_time_class(priority: int) -> bool:
    """Put this thread into the real-time class, if it is in none; return whether it is in it."""
    before = _find_class()
    if before is None:
        return False
    if before not in USUAL:
        return True
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(priority))
    except OSError:
        return False
    return True


def _find_class() -> int | None:
    """Return the class of this thread; None if the system does not say."""
    if not IS_KNOWN:
        return None
    try:
        return os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK
    except OSError:
        return None
