"""Files: written completely or not at all, and read up to a size."""

from __future__ import annotations

import errno
import os
import secrets
import shutil
import stat
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

MAX_LINKS = 40  # as many symbolic links in a row as Linux follows
KINDS = {
    stat.S_IFIFO: "FIFO",
    stat.S_IFSOCK: "socket",
    stat.S_IFCHR: "device",
    stat.S_IFBLK: "device",
}


def read_bounded(path: Path, max_bytes: int) -> bytes:
    """Read a file after `check_file`, and raise as that does."""
    size = check_file(path, max_bytes)
    with path.open("rb") as file:
        content = file.read(size + 1)  # Python sets aside as many bytes as are asked for
        if len(content) > size:  # it has grown, or the system did not know its size
            content += file.read(max_bytes + 1 - len(content))
    if len(content) > max_bytes:
        raise ValueError(_describe_size(max_bytes))
    return content


def check_file(path: Path, max_bytes: int) -> int:
    """Check that a path leads to a regular file of a limited size; return its size [bytes].

    Other files, such as a FIFO, may block a reader forever: they raise `OSError`, and a larger
    one `ValueError`.
    """
    found = path.stat()
    kind = stat.S_IFMT(found.st_mode)
    if kind == stat.S_IFDIR:
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    if kind != stat.S_IFREG:
        raise OSError(errno.EINVAL, f"it is a {KINDS[kind]}, expected a file", str(path))
    if found.st_size > max_bytes:
        raise ValueError(_describe_size(max_bytes))
    return found.st_size


def _describe_size(max_bytes: int) -> str:
    return f"it has more than {max_bytes} bytes, expected a smaller file"


def describe(error: Exception) -> str:
    """Describe why a file could not be read or written, in one line without its name."""
    reason = error.strerror if isinstance(error, OSError) else None
    return " ".join((reason or str(error) or type(error).__name__).split())


def readable(name: str) -> str:
    r"""Escape bytes of a file name that are not UTF-8 as \xff, which can be printed anywhere."""
    return name.encode("utf-8", "surrogateescape").decode("utf-8", "backslashreplace")


def write_atomically(path: Path, content: str | bytes) -> None:
    """Write a file, text as UTF-8; see :func:`atomic_path`."""
    with atomic_path(path) as partial:
        partial.write_bytes(content.encode("utf-8") if isinstance(content, str) else content)


@contextmanager
def atomic_path(path: Path) -> Iterator[Path]:
    """Yield the path of a temporary file that becomes ``path`` when the block ends.

    A reader sees the old file or the complete new one. If the block raises, the old file
    stays and the temporary file is removed. Symbolic links are followed and stay. What is
    not a regular file, such as a FIFO, a terminal or /dev/stdout, is written through.
    """
    target = _follow_links(path)
    mode = _find_mode(target)
    if mode is not None and stat.S_ISDIR(mode):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    is_stream = target.is_relative_to("/proc") or (mode is not None and not stat.S_ISREG(mode))
    folder = Path(tempfile.gettempdir()) if is_stream else target.parent
    # A short name of its own: `path.name` may already be as long as names can be.
    partial = folder / f".getup-{os.getpid()}-{secrets.token_hex(4)}.tmp"
    try:
        yield partial
        if is_stream:
            with partial.open("rb") as source, target.open("wb") as stream:
                shutil.copyfileobj(source, stream)
        else:
            if mode is not None:
                partial.chmod(stat.S_IMODE(mode))
            partial.replace(target)
    except OSError as error:
        if error.filename in (None, str(partial)):  # a full disk is reported without a name
            error.filename = str(path)
        raise
    finally:
        partial.unlink(missing_ok=True)


@contextmanager
def atomic_folder(folder: Path) -> Iterator[Path]:
    """Yield a temporary folder that becomes ``folder`` when the block ends.

    If the block raises, nothing is left of it.
    """
    folder.parent.mkdir(parents=True, exist_ok=True)
    partial = folder.parent / f".getup-{os.getpid()}-{secrets.token_hex(4)}.tmp"
    partial.mkdir()
    try:
        yield partial
        if folder.exists():
            folder.rmdir()
        partial.replace(folder)
    finally:
        shutil.rmtree(partial, ignore_errors=True)


def _follow_links(path: Path) -> Path:
    """Follow symbolic links, except those of /proc, which lead to open files."""
    for _ in range(MAX_LINKS):
        path = path.parent.resolve() / path.name
        if path.is_relative_to("/proc") or not path.is_symlink():
            return path
        path = path.parent / path.readlink()
    raise OSError(errno.ELOOP, os.strerror(errno.ELOOP), str(path))


def _find_mode(path: Path) -> int | None:
    try:
        return path.stat().st_mode
    except FileNotFoundError:
        return None
