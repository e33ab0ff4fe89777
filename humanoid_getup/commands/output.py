"""Output of results: names of files, and JSON."""

from __future__ import annotations

import sys
from pathlib import Path

from humanoid_getup.commands.errors import BadInputError
from humanoid_getup.commands.files import STANDARD_OUTPUT
from humanoid_getup.commands.options import JobRequest


def find_json_target(command: JobRequest | None) -> str | None:
    """Return the file of a command's JSON, "-" for standard output, ``None`` for none."""
    return getattr(command, "json", None)


def write_json(result: object, command: JobRequest) -> None:
    """Write a result as JSON to the target of a command: a file, standard output, or none."""
    json = find_json_target(command)
    if json is None:
        return
    from robots.storage.encoding import to_json  # loads NumPy, which --help does without

    if json == STANDARD_OUTPUT:
        sys.stdout.write(to_json(result))
        return
    from robots.storage.files import write_atomically

    try:
        Path(json).parent.mkdir(parents=True, exist_ok=True)
        write_atomically(Path(json), to_json(result))
    except OSError as error:
        raise BadInputError(f"output file {json}: {error.strerror}") from error
