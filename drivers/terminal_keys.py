"""Keys of a terminal, reported one press at a time from a thread of its own; stop keys."""

from __future__ import annotations

import contextlib
import os
import select
import sys
import termios
import threading
import tty
from collections.abc import Callable
from typing import Self

PRESSED, LOST = "the operator pressed a key", "the terminal is gone"  # why a stop key stops
MOST_BYTES = 4096  # of one press: an arrow key sends three, a pasted text many


class TerminalKeys:
    """Watches a terminal in its own thread, inside a ``with`` block.

    Without a terminal there are no keys.
    """

    def __init__(self, on_press: Callable[[bytes], None], terminal: int | None = None) -> None:
        """Prepare to watch a terminal, by file descriptor; ``None`` for standard input.

        ``on_press`` is called at every press, from the watching thread, with the bytes that it
        sent; without any when the terminal is gone.
        """
        self._on_press = on_press
        self._terminal = find_standard_input() if terminal is None else terminal
        self._thread: threading.Thread | None = None

    @property
    def has_terminal(self) -> bool:
        """Return whether there is a terminal whose keys can be watched."""
        return self._terminal is not None and os.isatty(self._terminal)

    def __enter__(self) -> Self:
        if self._terminal is not None and self.has_terminal:
            self._before = termios.tcgetattr(self._terminal)
            tty.setcbreak(self._terminal)
            self._wake, self._waker = os.pipe()
            self._thread = threading.Thread(target=self._watch, name="terminal keys", daemon=True)
            self._thread.start()
        return self

    def __exit__(self, *error: object) -> None:
        if self._thread is None or self._terminal is None:
            return
        os.close(self._waker)
        self._thread.join()
        os.close(self._wake)
        self._thread = None
        with contextlib.suppress(termios.error):  # a terminal that is gone has no settings
            termios.tcsetattr(self._terminal, termios.TCSADRAIN, self._before)

    def _watch(self) -> None:
        assert self._terminal is not None
        sent = b"any"
        while sent:
            ready, _, _ = select.select([self._terminal, self._wake], [], [])
            if self._terminal not in ready:
                return
            try:
                sent = os.read(self._terminal, MOST_BYTES)
            except OSError:
                sent = b""
            self._on_press(sent)


class StopKey(TerminalKeys):
    """Watches a terminal for any key, inside a ``with`` block.

    Without a terminal there is no stop key; signals still stop the program.
    """

    def __init__(self, stop: Callable[[str], None], terminal: int | None = None) -> None:
        """Prepare to watch a terminal, by file descriptor; ``None`` for standard input.

        ``stop`` is called at every key, with the reason, from the watching thread.
        """
        super().__init__(lambda sent: stop(PRESSED if sent else LOST), terminal)


def find_standard_input() -> int | None:
    """Return the file descriptor of standard input, if there is one."""
    try:
        return sys.stdin.fileno()
    except (AttributeError, OSError, ValueError):  # closed, or a test's stand-in
        return None
