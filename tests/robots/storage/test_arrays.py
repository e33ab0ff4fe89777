"""Array files: what was saved comes back; damage, bombs and objects are refused beforehand."""

import io
import pickle
import struct
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest

from robots.storage.arrays import (
    MAX_BYTES,
    ArchiveError,
    load_arrays,
    save_arrays,
    to_numbers,
    to_text,
)

ARRAYS = {
    "text": np.array("sit-up"),
    "texts": np.array(["left", "right"]),
    "numbers": np.random.default_rng(0).normal(size=(5, 3)),
    "turned": np.asfortranarray(np.arange(6.0).reshape(2, 3)),
    "flags": np.array([True, False]),
    "seed": np.array(7),
}


def write_members(file: Path, members: dict[str, bytes], method: int = zipfile.ZIP_DEFLATED):
    with zipfile.ZipFile(file, "w", method) as archive:
        for name, content in members.items():
            archive.writestr(name, content)


def to_npy(array: np.ndarray) -> bytes:
    stream = io.BytesIO()
    np.save(stream, array)
    return stream.getvalue()


def write_bomb(file: Path, size: int) -> Path:
    """Write an honest archive whose one array of zeros unpacks to ``size`` bytes."""
    with (
        zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive,
        archive.open("a.npy", "w", force_zip64=True) as stream,
    ):
        stream.write(header_of((size // 8,)))
        for _ in range(size // 2**20):
            stream.write(bytes(2**20))
    return file


def header_of(shape: tuple[int, ...], dtype: str = "<f8") -> bytes:
    stream = io.BytesIO()
    header = {"descr": dtype, "fortran_order": False, "shape": shape}
    np.lib.format.write_array_header_1_0(stream, header)
    return stream.getvalue()


def test_what_was_saved_comes_back(tmp_path: Path):
    save_arrays(tmp_path / "a.npz", ARRAYS)
    read = load_arrays(tmp_path / "a.npz", ARRAYS)
    assert list(read) == list(ARRAYS)
    for key, array in ARRAYS.items():
        assert np.array_equal(read[key], array)
        assert read[key].dtype == array.dtype
        assert read[key].flags.f_contiguous == array.flags.f_contiguous, "another layout in memory"
        assert read[key].flags.writeable


def test_a_bomb_is_refused_unread(tmp_path: Path):
    file = write_bomb(tmp_path / "a.npz", MAX_BYTES + 2**20)
    assert file.stat().st_size < MAX_BYTES // 100
    with pytest.raises(ArchiveError, match=r"unpacks to \d+ bytes, expected at most"):
        load_arrays(file, ("a",))


def test_a_bomb_that_lies_about_its_size_is_not_unpacked(tmp_path: Path):
    """The directory states 800 bytes for many; its reader stays small."""
    file = write_bomb(tmp_path / "a.npz", 300 * 2**20)
    content = bytearray(file.read_bytes())
    entry = content.rindex(b"PK\x01\x02")
    content[entry + 24 : entry + 28] = struct.pack("<I", len(header_of((100,))) + 800)
    file.write_bytes(bytes(content))
    program = (
        "import sys; from pathlib import Path; import robots.storage.arrays as arrays\n"
        "try: arrays.load_arrays(Path(sys.argv[1]), ('a',))\n"
        "except arrays.ArchiveError as error: print(error)\n"
        "print(Path('/proc/self/status').read_text().split('VmHWM:')[1].split()[0])"
    )
    command = [sys.executable, "-c", program, str(file)]
    result = subprocess.run(command, capture_output=True, text=True, check=True)
    message, peak = result.stdout.splitlines()
    assert "damaged" in message or "expected" in message
    assert int(peak) < 250_000, "kilobytes of memory"


@pytest.mark.parametrize(
    "header",
    [
        header_of((2**40,)),
        header_of((2**62, 2**62)),
        header_of((7,)),
        header_of((-1,)),
        header_of((2**40,), "<U0"),
        header_of((1,), "|O"),
        header_of((1,), "|V8"),
        b"\x93NUMPY\x09\x00" + header_of((1,))[8:],
        b"\x93NUMPY\x01\x00\xff\xff" + b"(" * 65535,
        b"",
    ],
)
def test_a_header_that_does_not_fit_the_content_is_refused(tmp_path: Path, header: bytes):
    write_members(tmp_path / "a.npz", {"a.npy": header + bytes(8)})
    with pytest.raises(ArchiveError) as refusal:
        load_arrays(tmp_path / "a.npz", ("a",))
    assert "\n" not in str(refusal.value)


class Malicious:
    def __init__(self, target: Path) -> None:
        self.target = target

    def __reduce__(self):
        return Path.touch, (self.target,)


def test_objects_are_not_unpickled(tmp_path: Path):
    target = tmp_path / "touched"
    array = np.array([Malicious(target)], dtype=object)
    np.savez(tmp_path / "a.npz", a=array)
    (tmp_path / "b.npz").write_bytes(pickle.dumps(Malicious(target)))
    for name in "ab":
        with pytest.raises(ArchiveError):
            load_arrays(tmp_path / f"{name}.npz", ("a",))
    assert not target.exists()


def test_other_packings_are_refused(tmp_path: Path):
    write_members(tmp_path / "a.npz", {"a.npy": to_npy(np.zeros(3))}, zipfile.ZIP_BZIP2)
    with pytest.raises(ArchiveError, match="packed by method"):
        load_arrays(tmp_path / "a.npz", ("a",))


def test_missing_and_unknown_and_doubled_keys_are_named(tmp_path: Path):
    write_members(tmp_path / "a.npz", {"a.npy": to_npy(np.zeros(3)), "b.npy": b""})
    with pytest.raises(ArchiveError, match="key 'c' is missing; unknown key 'b'"):
        load_arrays(tmp_path / "a.npz", ("a", "c"))
    with (
        pytest.warns(UserWarning, match="Duplicate"),
        zipfile.ZipFile(tmp_path / "a.npz", "w") as archive,
    ):
        for _ in range(2):
            archive.writestr("a.npy", to_npy(np.zeros(3)))
    with pytest.raises(ArchiveError, match="2 members, expected 1"):
        load_arrays(tmp_path / "a.npz", ("a",))


def test_no_flipped_bit_changes_an_array(tmp_path: Path):
    """Either the file is refused, or what comes back is what was saved."""
    file = tmp_path / "a.npz"
    save_arrays(file, ARRAYS)
    content, refused = file.read_bytes(), 0
    for at in range(0, len(content), 7):
        damaged = bytearray(content)
        damaged[at] ^= 1 << at % 8
        file.write_bytes(bytes(damaged))
        try:
            read = load_arrays(file, ARRAYS)
        except ArchiveError:
            refused += 1
            continue
        assert all(np.array_equal(read[key], ARRAYS[key]) for key in ARRAYS), at
    assert refused > 50


def test_a_truncated_or_too_large_file_is_refused(tmp_path: Path):
    file = tmp_path / "a.npz"
    save_arrays(file, ARRAYS)
    content = file.read_bytes()
    with pytest.raises(ArchiveError, match="more than 100 bytes"):
        load_arrays(file, ARRAYS, max_bytes=100)
    for length in (0, 3, 100, -1, -22, -300):
        file.write_bytes(content[:length])
        with pytest.raises(ArchiveError):
            load_arrays(file, ARRAYS)


def test_texts_and_numbers_are_distinguished_from_each_other():
    assert to_text(np.array("a"), "key") == "a"
    assert to_numbers(np.array([1, 2]), "key", (None,)).tolist() == [1.0, 2.0]
    for wrong in (np.array(["a"]), np.array(1.0)):
        with pytest.raises(ArchiveError, match="key is not a text"):
            to_text(wrong, "key")
    for wrong, message in (
        (np.array("a"), "not an array of numbers"),
        (np.zeros(3), r"shape \(3,\), expected \(any, 2\)"),
        (np.zeros((3, 1)), r"shape \(3, 1\), expected \(any, 2\)"),
        (np.array([[1.0, np.inf]]), "holds inf, expected finite"),
    ):
        with pytest.raises(ArchiveError, match=message):
            to_numbers(wrong, "key", (None, 2))
