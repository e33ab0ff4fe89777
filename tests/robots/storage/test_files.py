"""Files are written complete or not at all, and nothing but a regular file is replaced."""

import os
import resource
import socket
import stat
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from robots.storage.files import (
    atomic_folder,
    atomic_path,
    describe,
    read_bounded,
    write_atomically,
)


def test_text_and_bytes_are_written_with_the_permissions_that_were(tmp_path: Path):
    (tmp_path / "text").write_text("old")
    (tmp_path / "text").chmod(0o640)
    write_atomically(tmp_path / "text", "N·m\n")
    write_atomically(tmp_path / "bytes", b"\x00\xff")
    assert (tmp_path / "text").read_bytes() == b"N\xc2\xb7m\n"
    assert stat.S_IMODE((tmp_path / "text").stat().st_mode) == 0o640
    assert (tmp_path / "bytes").read_bytes() == b"\x00\xff"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["bytes", "text"]


def test_a_failure_leaves_the_old_file_and_nothing_else(tmp_path: Path):
    file = tmp_path / "report.json"
    file.write_text("old")
    with pytest.raises(ZeroDivisionError), atomic_path(file) as partial:
        partial.write_text("half")
        _ = 1 / 0
    assert file.read_text() == "old"
    assert list(tmp_path.iterdir()) == [file]


@pytest.mark.parametrize("exists", [True, False])
def test_symbolic_links_are_followed_and_stay(tmp_path: Path, exists: bool):
    target = tmp_path / "elsewhere" / "target"
    target.parent.mkdir()
    if exists:
        target.write_text("old")
    (tmp_path / "second").symlink_to(target)
    (tmp_path / "first").symlink_to("second")
    write_atomically(tmp_path / "first", "new")
    assert target.read_text() == "new"
    assert (tmp_path / "first").is_symlink()
    assert (tmp_path / "second").is_symlink()
    assert list(target.parent.iterdir()) == [target]


def test_a_directory_is_refused_before_the_work(tmp_path: Path):
    folder = tmp_path / "folder"
    folder.mkdir()
    with pytest.raises(IsADirectoryError), atomic_path(folder):
        pytest.fail("the block was entered")
    assert folder.is_dir()


def test_a_fifo_is_written_through(tmp_path: Path):
    fifo = tmp_path / "fifo"
    os.mkfifo(fifo)
    received: list[bytes] = []
    reader = threading.Thread(target=lambda: received.append(fifo.read_bytes()))
    reader.start()
    write_atomically(fifo, "through")
    reader.join()
    assert received == [b"through"]
    assert stat.S_ISFIFO(fifo.stat().st_mode)
    assert list(tmp_path.iterdir()) == [fifo]


@pytest.mark.parametrize(
    ("through", "into"), [("/dev/stdout", "pipe"), ("/proc/self/fd/1", "file"), ("link", "file")]
)
def test_standard_output_is_written_through(tmp_path: Path, through: str, into: str):
    link = tmp_path / "link"
    link.symlink_to("/dev/stdout")
    path = link if through == "link" else Path(through)
    program = (
        "import sys; from pathlib import Path; from robots.storage.files import write_atomically; "
        f"write_atomically(Path({str(path)!r}), 'content'); "
    )
    command = [sys.executable, "-c", program]
    if into == "pipe":
        assert subprocess.run(command, capture_output=True, check=True).stdout == b"content"
        return
    file = tmp_path / "out.txt"
    with file.open("wb") as stream:
        before = file.stat().st_ino
        subprocess.run(command, stdout=stream, check=True)
    assert file.read_bytes() == b"content"
    assert file.stat().st_ino == before, "the file behind standard output was replaced"


def test_a_file_is_read_up_to_its_limit_and_refused_beyond(tmp_path: Path):
    path = tmp_path / "file"
    for size in (0, 9, 10):
        path.write_bytes(b"x" * size)
        assert read_bounded(path, 10) == b"x" * size
    for size in (11, 1000):
        path.write_bytes(b"x" * size)
        with pytest.raises(ValueError, match="more than 10 bytes"):
            read_bounded(path, 10)


@pytest.mark.parametrize("kind", ["FIFO", "socket", "device"])
def test_what_may_never_end_is_not_read(tmp_path: Path, kind: str):
    path = tmp_path / "file"
    if kind == "FIFO":
        os.mkfifo(path)
    elif kind == "socket":
        listener = socket.socket(socket.AF_UNIX)
        listener.bind(str(path))
        listener.close()
    else:
        path = Path("/dev/zero")
    with pytest.raises(OSError, match=f"it is a {kind}, expected a file"):
        read_bounded(path, 10)


def test_a_full_disk_is_reported_with_the_name_of_the_file(tmp_path: Path):
    """A disk is full for a file of more than so many bytes."""
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    with pytest.raises(OSError, match="too large") as caught:
        resource.setrlimit(resource.RLIMIT_FSIZE, (100, limits[1]))
        try:
            write_atomically(tmp_path / "report.json", "x" * 1000)
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert caught.value.filename == str(tmp_path / "report.json")
    assert list(tmp_path.iterdir()) == []


def test_an_error_is_described_in_one_line_without_the_name_of_the_file():
    assert describe(FileNotFoundError(2, "No such file", "a")) == "No such file"
    assert describe(OSError("broken")) == "broken"
    assert describe(ValueError("a\n  b")) == "a b"
    assert describe(MemoryError()) == "MemoryError"


def test_a_folder_appears_whole_or_not_at_all(tmp_path: Path):
    folder = tmp_path / "new" / "folder"
    with pytest.raises(KeyError), atomic_folder(folder) as partial:
        (partial / "half").write_text("half")
        raise KeyError
    assert list(folder.parent.iterdir()) == []
    folder.mkdir()
    with atomic_folder(folder) as partial:
        (partial / "whole").write_text("whole")
        assert list(folder.iterdir()) == []
    assert [path.name for path in folder.iterdir()] == ["whole"]
    with pytest.raises(OSError), atomic_folder(folder):
        pass
    assert [path.name for path in folder.parent.iterdir()] == ["folder"]
    assert [path.name for path in folder.iterdir()] == ["whole"]
