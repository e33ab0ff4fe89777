"""The exact command line of a request."""

from __future__ import annotations

import shlex
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import MISSING, Field, fields, replace
from typing import Any, get_args, get_type_hints

from tyro.conf import Positional

from humanoid_getup.jobs.requests.shared import JobRequest


def write_command(name: str, request: JobRequest) -> str:
    """Write the command line of a request, without defaults."""
    hints = get_type_hints(type(request), include_extras=True)
    words, options = ["getup", *name.split()], list[str]()
    for field in fields(request):
        value = getattr(request, field.name)
        if value == _find_default(field):
            continue
        if Positional in get_args(hints[field.name]):
            words += [str(item) for item in (value if isinstance(value, tuple) else (value,))]
        else:
            options += _write_option(_find_name(field.name, hints[field.name]), value)
    return shlex.join([*words, *options])


@contextmanager
def hinting_resume(name: str, request: Any) -> Iterator[None]:
    """Add the command that resumes the work to an interrupt (`KeyboardInterrupt`)."""
    try:
        yield
    except KeyboardInterrupt as interrupt:
        again = write_command(name, replace(request, resume=True))
        raise KeyboardInterrupt(f"{again} continues") from interrupt


def _find_default(field: Field[Any]) -> Any:
    return None if field.default is MISSING else field.default


def _find_name(name: str, hint: Any) -> str:
    """Return the name of an option, which its type may override."""
    names = (getattr(note, "name", None) for note in get_args(hint))
    renamed = next((name for name in names if isinstance(name, str)), None)
    return (renamed or name).replace("_", "-")


def _write_option(name: str, value: object) -> list[str]:
    if isinstance(value, bool):
        return [f"--{name}" if value else f"--no-{name}"]
    if isinstance(value, tuple):
        return [f"--{name}", ",".join(map(str, value))]
    return [f"--{name}", str(value)]
