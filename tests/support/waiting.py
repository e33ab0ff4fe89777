"""Wait for an event instead of for time to pass."""

import time
from collections.abc import Callable

LONGEST_WAIT = 60.0  # s; only a broken program ever waits so long


def wait_until(condition: Callable[[], bool]) -> None:
    """Wait until a condition holds; fail if it never does."""
    end = time.monotonic() + LONGEST_WAIT
    while not condition():
        assert time.monotonic() < end, "the condition never came true"
        time.sleep(0.001)
