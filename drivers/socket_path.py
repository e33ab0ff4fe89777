"""Paths of UNIX sockets: the system takes 107 bytes, folders for temporary files may need more."""

from __future__ import annotations

import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

LONGEST_PATH = 107  # bytes (Linux, un.h)
LONGEST_NAME = LONGEST_PATH - len("/proc/self/fd/9999/")


@contextmanager
def reaching(path: Path) -> Iterator[str]:
    """Yield a path short enough for a socket: a long one leads through its opened folder."""
    if len(os.fsencode(path)) <= LONGEST_PATH:
        yield str(path)
        return
    if len(os.fsencode(path.name)) > LONGEST_NAME:
        raise OSError(errno.ENAMETOOLONG, os.strerror(errno.ENAMETOOLONG), str(path))
    folder = os.open(path.parent, os.O_RDONLY | os.O_DIRECTORY)
    try:
        yield f"/proc/self/fd/{folder}/{path.name}"
    finally:
        os.close(folder)
