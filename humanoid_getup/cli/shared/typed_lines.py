"""Lines that are typed while a command works."""

from __future__ import annotations

import os
import select
import threading

from drivers.terminal_keys import find_standard_input

MOST_BYTES = 4096  # of one read


class TypedLines:
    """Reads standard input without ever waiting for it.

    A terminal is read only while the command is in its foreground: a background command that reads
    is stopped by the shell.
    """

    def __init__(self, source: int | None = None) -> None:
        """Prepare to read a file descriptor; ``None`` for standard input, if there is one."""
        self._source = find_standard_input() if source is None else source
        self._begun = b""
        self._never = threading.Event()

    def wait(self, seconds: float) -> list[str]:
        """Wait a time [s] at most; return the lines typed meanwhile, without empty ones."""
        if self._source is None or not _is_in_foreground(self._source):
            self._never.wait(seconds)
            return []
        ready, _, _ = select.select([self._source], [], [], seconds)
        if not ready:
            return []
        try:
            sent = os.read(self._source, MOST_BYTES)
        except OSError:  # the terminal is gone
            sent = b""
        if not sent:
            self._source = None
        *lines, self._begun = (self._begun + sent).split(b"\n")
        return [text for line in lines if (text := line.decode(errors="replace").strip())]


def _is_in_foreground(source: int) -> bool:
    """Return whether a file may be read: a terminal only by the command in its foreground."""
    try:
        return not os.isatty(source) or os.tcgetpgrp(source) == os.getpgrp()
    except OSError:
        return False
