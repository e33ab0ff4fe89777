"""Array files (.npz): sizes are checked before anything is unpacked, and nothing is unpickled."""

from __future__ import annotations

import math
import zipfile
import zlib
from collections.abc import Collection, Mapping
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robots.storage.files import atomic_path, read_bounded
from robots.storage.validation import shown

MAX_BYTES = 64 * 2**20  # unpacked; far above what the product writes
MAX_HEADER = 4096  # characters; np.save writes about 120
NUMBERS, TEXTS = "fiub", "U"
DAMAGE = (ValueError, TypeError, EOFError, KeyError, RuntimeError, MemoryError, AttributeError)
"""Errors that zipfile and numpy raise for damaged content, besides their own."""


class ArchiveError(ValueError):
    """A file is not the expected archive of arrays; the message is the reason, in one line."""


def save_arrays(path: Path, arrays: Mapping[str, Any]) -> None:
    """Write arrays, numbers and texts as a compressed .npz file, completely or not at all."""
    with atomic_path(path) as partial, partial.open("wb") as file:
        np.savez_compressed(file, **arrays)


def load_arrays(
    path: Path, keys: Collection[str], *, optional: Collection[str] = (), max_bytes: int = MAX_BYTES
) -> dict[str, NDArray[Any]]:
    """Read the arrays of an .npz file: numbers and texts, by the names that it must or may have.

    ``max_bytes`` limits the file and all its arrays together. Raises `OSError` or `ArchiveError`.
    """
    try:
        content = read_bounded(path, max_bytes)
        if not content.startswith(b"PK\x03\x04"):
            raise ArchiveError("it is not an .npz archive")
        with zipfile.ZipFile(BytesIO(content)) as archive:
            found = _check_directory(archive, keys, optional, max_bytes)
            return {key: _read_array(archive, key) for key in (*keys, *optional) if key in found}
    except ArchiveError:
        raise
    except (zipfile.BadZipFile, zlib.error, *DAMAGE) as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise ArchiveError(f"it is damaged: {reason}") from error


def to_text(array: NDArray[Any], key: str) -> str:
    """Return the one text that an array must hold."""
    if array.shape != () or array.dtype.kind not in TEXTS:
        raise ArchiveError(f"{key} is not a text")
    return str(array)


def check_robot(array: NDArray[Any], name: str) -> None:
    """Check that an archive belongs to a robot, by the array that holds its name."""
    found = to_text(array, "robot")
    if found != name:
        raise ArchiveError(f"it is of robot '{found}', expected '{name}'")


def to_numbers(array: NDArray[Any], key: str, shape: tuple[int | None, ...]) -> NDArray[np.float64]:
    """Return an array as finite numbers of a shape; None in it stands for any length."""
    if array.dtype.kind not in NUMBERS:
        raise ArchiveError(f"{key} is not an array of numbers")
    fits = len(array.shape) == len(shape) and all(
        wanted in (None, found) for found, wanted in zip(array.shape, shape, strict=True)
    )
    if not fits:
        expected = f"({', '.join('any' if size is None else str(size) for size in shape)})"
        raise ArchiveError(f"{key} has shape {array.shape}, expected {expected}")
    numbers = array.astype(float)
    if not np.isfinite(numbers).all():
        raise ArchiveError(f"{key} holds {numbers[~np.isfinite(numbers)][0]}, expected finite")
    return numbers


def _check_directory(
    archive: zipfile.ZipFile, keys: Collection[str], optional: Collection[str], max_bytes: int
) -> list[str]:
    """Check names and sizes as the archive's directory states them; return the names."""
    members = archive.infolist()
    found = [member.filename.removesuffix(".npy") for member in members]
    problems = [f"key '{key}' is missing" for key in keys if key not in found]
    problems += [f"unknown key {shown(key)}" for key in found[:20] if key not in {*keys, *optional}]
    if not problems and len(found) != len(set(found)):
        problems.append(f"it has {len(found)} members, expected {len(set(found))}")
    size = sum(member.file_size for member in members)
    if size > max_bytes:
        problems.append(f"it unpacks to {size} bytes, expected at most {max_bytes}")
    problems += [
        f"key {shown(name)} is packed by method {member.compress_type}, expected 0 or 8"
        for name, member in zip(found, members, strict=True)
        if member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
    ]
    if problems:
        raise ArchiveError("; ".join(problems[:20]))
    return found


def _read_array(archive: zipfile.ZipFile, key: str) -> NDArray[Any]:
    """Read one array; its header must agree with the size that the directory states."""
    member = archive.getinfo(f"{key}.npy")
    with archive.open(member) as stream:
        # A member that unpacks to more than its stated size is not read beyond that.
        content = stream.read(member.file_size)
        at_end = stream.read(1) == b""  # the checksum is compared at the end
    header = BytesIO(content)
    read_header = {
        (1, 0): np.lib.format.read_array_header_1_0,
        (2, 0): np.lib.format.read_array_header_2_0,
    }.get(np.lib.format.read_magic(header))
    if read_header is None:
        raise ArchiveError(f"{key} has an unknown format")
    shape, is_fortran, dtype = read_header(header, max_header_size=MAX_HEADER)
    if dtype.kind not in NUMBERS + TEXTS or dtype.itemsize == 0:
        raise ArchiveError(f"{key} has type {dtype}, expected numbers or text")
    size, stated = len(content) - header.tell(), math.prod(shape) * dtype.itemsize
    if not at_end or size != stated:
        raise ArchiveError(f"{key} has {size} bytes, expected {stated} for its shape {shape}")
    values = np.frombuffer(content, dtype, offset=header.tell())
    return values.reshape(shape, order="F" if is_fortran else "C").copy(order="K")
