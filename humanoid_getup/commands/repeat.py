"""The command that resumes interrupted work."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

from humanoid_getup.commands.options import write_command


@contextmanager
def hinting_resume(name: str, request: Any, is_begun: Callable[[Any], bool]) -> Iterator[None]:
    """Add the command that resumes the work to an interrupt (`KeyboardInterrupt`).

    ``is_begun`` tells whether anything of the request was kept.
    """
    try:
        yield
    except KeyboardInterrupt as interrupt:
        if not is_begun(request):
            raise
        again = write_command(name, replace(request, resume=True))
        raise KeyboardInterrupt(f"{again} continues") from interrupt
