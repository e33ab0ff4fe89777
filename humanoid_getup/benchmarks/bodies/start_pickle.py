"""Reads start states that are pickled, without running anything that a pickle asks for.

A pickle is a program, which names functions and calls them as it is loaded. Only the instructions
that write lists of arrays are accepted, and every name stands for a class of this file that keeps
bytes; a name beyond those of a plain numpy array ends the reading.
"""

from __future__ import annotations

import io
import math
import pickle
import pickletools
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from robots.quaternion import Array
from robots.storage.files import describe, read_bounded
from robots.storage.validation import shown

MAX_BYTES = 64 * 2**20
LITTLE_ENDIAN = "<"
NUMBERS = ("f8", "f4")
INSTRUCTIONS = (
    *("PROTO", "FRAME", "STOP", "MARK", "MEMOIZE", "BINPUT", "LONG_BINPUT"),
    *("BINGET", "LONG_BINGET", "EMPTY_LIST", "APPEND", "APPENDS", "EMPTY_TUPLE"),
    *("TUPLE", "TUPLE1", "TUPLE2", "TUPLE3", "NONE", "NEWTRUE", "NEWFALSE"),
    *("BININT", "BININT1", "BININT2", "SHORT_BINUNICODE", "BINUNICODE"),
    *("SHORT_BINBYTES", "BINBYTES", "BYTEARRAY8"),
    *("GLOBAL", "STACK_GLOBAL", "REDUCE", "BUILD"),
)
"""Instructions that write lists of arrays."""
DAMAGE = (
    *(pickle.UnpicklingError, EOFError, ValueError, TypeError, AttributeError),
    *(LookupError, ImportError, MemoryError, RecursionError, OverflowError, NotImplementedError),
)
"""Errors that unpickling raises for damaged content."""


class StartPickleError(ValueError):
    """A file of start states cannot be read; the message is the reason, in one line."""


class _ArrayType:
    """Stands for `numpy.ndarray`, which only names what `_PickledArray` is."""

    __slots__ = ()

    def __init__(self, *_: object) -> None:
        raise StartPickleError("it makes an array in an unknown way")


class _PickledType:
    """Stands for a `numpy.dtype`."""

    __slots__ = ("code", "order")

    def __init__(self, code: object = None, *_: object) -> None:
        self.code, self.order = code, ""

    def __setstate__(self, state: Sequence[Any]) -> None:
        self.order = str(state[1])


class _PickledArray:
    """Stands for the function that makes an empty array, which is filled by its state."""

    __slots__ = ("values",)

    def __init__(self, *_: object) -> None:
        self.values: Array | None = None

    def __setstate__(self, state: Sequence[Any]) -> None:
        _, shape, kind, _, content = state
        self.fill(shape, kind, content)

    def fill(self, shape: object, kind: object, content: object) -> None:
        """Take the numbers of a vector.

        Raises:
            StartPickleError: if it is another array.
        """
        code = kind.code if isinstance(kind, _PickledType) and kind.order == LITTLE_ENDIAN else ""
        if code not in NUMBERS or not isinstance(content, bytes | bytearray):
            raise StartPickleError("it holds an array of another kind than numbers f4 or f8")
        values = np.frombuffer(content, f"{LITTLE_ENDIAN}{code}").astype(float)
        if shape != values.shape:
            raise StartPickleError(f"it holds an array of shape {shown(shape)}, expected a vector")
        self.values = values


class _BufferedArray(_PickledArray):
    """Stands for the function that makes an array from a buffer, as protocol 5 has it."""

    __slots__ = ()

    def __init__(self, content: object, kind: object, shape: object, *_: object) -> None:
        self.fill(shape, kind, content)


NAMES: dict[tuple[str, str], type] = {
    ("numpy", "ndarray"): _ArrayType,
    ("numpy", "dtype"): _PickledType,
    **{
        (f"numpy.{core}.{module}", name): kind
        for core in ("core", "_core")
        for module, name, kind in (
            ("multiarray", "_reconstruct", _PickledArray),
            ("numeric", "_frombuffer", _BufferedArray),
        )
    },
}
"""All that a file of start states may name."""


class _ArrayUnpickler(pickle.Unpickler):
    def find_class(self, module: str, name: str) -> type:
        """Return what a name stands for.

        Raises:
            StartPickleError: if a plain array needs no such name.
        """
        if (module, name) not in NAMES:
            raise StartPickleError(
                f"it names {shown(f'{module}.{name}')}, expected numpy arrays alone: not loaded"
            )
        return NAMES[module, name]


def read_start_pickle(path: Path) -> list[tuple[Array, Array]]:
    """Read the start states of a pickle: positions (nq,) and controls (nu,) of each.

    Raises:
        StartPickleError: if it cannot be read, or holds anything but pairs of finite vectors.
    """
    try:
        content = read_bounded(path, MAX_BYTES)
        _check_instructions(content)
        states = _ArrayUnpickler(io.BytesIO(content)).load()
    except StartPickleError as error:
        raise StartPickleError(f"{path}: {error}") from None
    except OSError as error:
        raise StartPickleError(f"{path}: {describe(error)}") from error
    except DAMAGE as error:
        raise StartPickleError(
            f"{path}: not a pickle of start states ({describe(error)})"
        ) from error
    if not isinstance(states, list) or not states:
        raise StartPickleError(f"{path}: holds no list, expected one of positions and controls")
    return [_read_state(path, number, state) for number, state in enumerate(states)]


def _check_instructions(content: bytes) -> None:
    """Check that a pickle has the instructions of lists of arrays alone, and few notes."""
    for instruction, argument, _ in pickletools.genops(content):
        if instruction.name not in INSTRUCTIONS:
            raise StartPickleError(
                f"it has the instruction {instruction.name}, expected numpy arrays alone: not "
                "loaded"
            )
        if instruction.name.endswith("PUT") and int(argument or 0) > len(content):
            raise StartPickleError("it numbers more objects than it has bytes: not loaded")


def _read_state(path: Path, number: int, state: object) -> tuple[Array, Array]:
    parts: Sequence[object] = state if isinstance(state, list | tuple) else ()
    values = [part.values for part in parts if isinstance(part, _PickledArray)]
    vectors = [each for each in values if each is not None]
    if not len(vectors) == len(parts) == 2:
        raise StartPickleError(
            f"{path}: start {number} is no pair of vectors, expected positions and controls"
        )
    if not all(math.isfinite(float(each.sum())) for each in vectors):
        raise StartPickleError(f"{path}: start {number} holds numbers that are not finite")
    return vectors[0], vectors[1]
