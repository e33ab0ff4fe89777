"""A person at the terminal: questions, the key q, typed lines."""

from __future__ import annotations

import contextlib
import os
import select
import sys
import termios
import threading

from rich.console import Console
from rich.markup import escape

from drivers.service.calibrate import Prompt, is_yes
from drivers.terminal_keys import TerminalKeys, find_standard_input
from humanoid_getup.commands.errors import BadInputError

MOST_BYTES = 4096  # of one read


class TerminalPrompt:
    """A person at the terminal."""

    def __init__(self, console: Console, unfinished: str) -> None:
        self._console, self._unfinished = console, unfinished

    def tell(self, text: str) -> None:
        """Print a line."""
        self._console.print(escape(text))

    def ask(self, question: str) -> str:
        """Print a question and read a line; what was typed before it is no answer."""
        _discard_typed()
        self._console.print(f"[bold]{escape(question)}[/]", end=" ")
        line = sys.stdin.readline()
        if not line:
            raise BadInputError(self._unfinished)
        return line.rstrip("\n")


def _discard_typed() -> None:
    """Discard what was typed at the terminal and not read yet."""
    with contextlib.suppress(OSError, ValueError, AttributeError, termios.error):
        termios.tcflush(sys.stdin.fileno(), termios.TCIFLUSH)


def open_prompt(console: Console, unfinished: str) -> Prompt | None:
    """Return the person at the terminal, ``None`` without a terminal.

    ``unfinished`` is said if the input ends before the last answer.
    """
    is_terminal = sys.stdin is not None and sys.stdin.isatty()
    return TerminalPrompt(console, unfinished) if is_terminal else None


def is_confirmed(console: Console, question: str, *, yes: bool) -> bool:
    """Return whether a person agrees, who did so already with ``--yes``."""
    if yes:
        return True
    prompt = open_prompt(console, "the input ended before the answer: nothing is written")
    if prompt is None:
        raise BadInputError("standard input is not a terminal: it cannot ask (or use --yes)")
    return is_yes(prompt.ask(f"{question} (yes does it)"))


class QuitKey(TerminalKeys):
    """Key q of the terminal, or its end, inside a ``with`` block."""

    def __init__(self, terminal: int | None = None) -> None:
        """Prepare to watch a terminal, by file descriptor; ``None`` for standard input."""
        super().__init__(self._note, terminal)
        self._pressed = threading.Event()
        self.is_pressed = self._pressed.is_set
        self.wait = self._pressed.wait

    def _note(self, sent: bytes) -> None:
        if sent.lower() in (b"q", b""):
            self._pressed.set()


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
