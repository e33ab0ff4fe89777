"""Command text: the line of the command line that a request stands for."""

from __future__ import annotations

import shlex
from collections.abc import Iterator
from dataclasses import MISSING, Field, fields
from typing import Any

from humanoid_getup.jobs.requests.shared import JobRequest
from humanoid_getup.jobs.requests.values import hints_of, name_option


def write_command(name: str, request: JobRequest) -> str:
    """Write the command of a name with the options of a request that are not at their defaults."""
    hints = hints_of(type(request))
    words = ["getup", *name.split()]
    for field in fields(request):
        words += _write_option(field, getattr(request, field.name), hints[field.name])
    return shlex.join(words)


def _write_option(field: Field[Any], value: Any, hint: Any) -> Iterator[str]:
    """Yield the words of an option; none for a default, the value alone for a positional one."""
    option = name_option(field.name, hint)
    is_default = field.default is not MISSING and value == field.default
    if value is None or (is_default and option.startswith("--")):
        return
    if isinstance(value, bool):
        yield option if value else f"--no-{option.removeprefix('--')}"
        return
    if option.startswith("--"):
        yield option
    yield ",".join(map(str, value)) if isinstance(value, tuple) else str(value)
