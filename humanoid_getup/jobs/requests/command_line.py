"""The exact command line of a request."""

from __future__ import annotations

import shlex
from dataclasses import MISSING, Field, fields
from typing import Any, get_type_hints

from humanoid_getup.jobs.requests.shared import JobRequest
from humanoid_getup.jobs.requests.values import name_option


def write_command(name: str, request: JobRequest) -> str:
    """Write the command line of a request, without defaults."""
    hints = get_type_hints(type(request), include_extras=True)
    words, options = ["getup", *name.split()], list[str]()
    for field in fields(request):
        value = getattr(request, field.name)
        if value == _find_default(field):
            continue
        name = name_option(field.name, hints[field.name])
        if name.startswith("--"):
            options += _write_option(name, value)
        else:
            words += [str(item) for item in (value if isinstance(value, tuple) else (value,))]
    return shlex.join([*words, *options])


def _find_default(field: Field[Any]) -> Any:
    return None if field.default is MISSING else field.default


def _write_option(name: str, value: object) -> list[str]:
    if isinstance(value, bool):
        return [name if value else f"--no-{name[2:]}"]
    if isinstance(value, tuple):
        return [name, ",".join(map(str, value))]
    if isinstance(value, float) and value.is_integer():
        return [name, str(int(value))]
    return [name, str(value)]
