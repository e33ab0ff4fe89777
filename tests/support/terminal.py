"""A program in a terminal, and a person who reads and types there."""

import os
import pty
import re
import select
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager

from waiting import LONGEST_WAIT

ESCAPES = re.compile(r"\x1b\[[0-9;?]*[A-Za-z]")


class Terminal:
    """A terminal with a program."""

    def __init__(self, master: int, program: subprocess.Popen) -> None:
        self._master, self._program = master, program
        self.shown = ""
        """All that the program has shown, without escape sequences."""
        self._read = 0

    def type(self, text: str) -> None:
        os.write(self._master, text.encode())

    def interrupt(self) -> None:
        self._program.send_signal(signal.SIGINT)

    def see(self, pattern: str, within: float = LONGEST_WAIT) -> re.Match:
        """Read until the program shows a pattern that was not seen yet."""
        end = time.monotonic() + within
        while not (found := re.compile(pattern).search(self.shown, self._read)):
            assert time.monotonic() < end, f"{pattern} is not in: {self.shown[-1500:]}"
            assert self._take(), f"{pattern} is not in, at its end: {self.shown[-1500:]}"
        self._read = found.end()
        return found

    def wait(self, within: float = LONGEST_WAIT) -> int:
        """Read to the end; return the exit code."""
        end = time.monotonic() + within
        while self._take():
            assert time.monotonic() < end, self.shown[-1500:]
        return self._program.wait(LONGEST_WAIT)

    def _take(self) -> bool:
        """Read what there is; return False at the end."""
        try:
            if select.select([self._master], [], [], 1.0)[0]:
                sent = os.read(self._master, 65536).decode(errors="replace")
                self.shown += ESCAPES.sub("", sent)
        except OSError:  # of a terminal that no program has
            return False
        return True


@contextmanager
def in_terminal(*arguments: str) -> Iterator[Terminal]:
    """Run `getup` in a terminal; end it afterwards."""
    master, slave = pty.openpty()
    environment = os.environ | {"TERM": "xterm", "COLUMNS": "240", "LINES": "40"}
    command = [sys.executable, "-m", "humanoid_getup.commands.main", *arguments]
    with subprocess.Popen(
        command, stdin=slave, stdout=slave, stderr=slave, env=environment
    ) as program:
        os.close(slave)
        try:
            yield Terminal(master, program)
        finally:
            program.kill()
            os.close(master)
