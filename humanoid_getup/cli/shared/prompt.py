"""Questions to a person at the terminal."""

from __future__ import annotations

import contextlib
import sys
import termios

from rich.console import Console
from rich.markup import escape

from drivers.service.calibrate import Prompt, is_yes
from humanoid_getup.jobs.errors import BadInputError


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
    """Return whether a person agrees, who did so already with ``--yes``.

    Raises:
        BadInputError: if there is no terminal to ask at.
    """
    if yes:
        return True
    prompt = open_prompt(console, "the input ended before the answer: nothing is written")
    if prompt is None:
        raise BadInputError("standard input is not a terminal: it cannot ask (or use --yes)")
    return is_yes(prompt.ask(f"{question} (yes does it)"))
