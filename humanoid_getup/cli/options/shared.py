"""Options of the command line alone: output of results."""

from __future__ import annotations

from dataclasses import dataclass, make_dataclass
from functools import cache
from pathlib import Path
from typing import Annotated

from tyro.conf import arg

from humanoid_getup.jobs.requests.files import WRITTEN
from humanoid_getup.jobs.requests.shared import JobRequest

JsonTarget = Annotated[
    str | None,
    WRITTEN,
    arg(metavar="FILE|-", help="Write the results as JSON to a file; - prints JSON alone."),
]


@dataclass(frozen=True, kw_only=True)
class JsonOption(JobRequest):
    """Option for the results as JSON."""

    json: JsonTarget = None


@dataclass(frozen=True, kw_only=True)
class PictureOption(JobRequest):
    """Option for a picture."""

    picture: Annotated[Path | None, WRITTEN, arg(metavar="FILE.png")] = None
    """Picture to write."""


@cache
def with_json(request: type[JobRequest]) -> type[JobRequest]:
    """Return the options of a command: a request, with an option for JSON."""
    namespace = {"__doc__": request.__doc__}
    bases = (JsonOption, request)
    name = request.__name__
    return make_dataclass(name, [], bases=bases, namespace=namespace, frozen=True, kw_only=True)
