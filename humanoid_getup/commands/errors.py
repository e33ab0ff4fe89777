"""Refusals of what a person asked for, and exit codes."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from opcode import opmap
from types import FrameType

DID_IT = 0
DID_NOT_STAND = NO_PATH = OUT_OF_MEMORY = 1
BAD_INPUT = 2
HARDWARE_FAULT = 3
INTERRUPTED = 130
CLOSED_PIPE = 141
OWN = {"humanoid_getup", "drivers", "robots", "sim2real"}
RAISE = opmap["RAISE_VARARGS"]


class BadInputError(ValueError):
    """An input of the user cannot be used; the message names it and what is expected."""

    def __init__(self, *problems: str) -> None:
        super().__init__("; ".join(problems))
        self.problems = problems
        """The problems, each printed on a line of its own."""


@contextmanager
def needing(extra: str) -> Iterator[None]:
    """Convert a missing package of an extra to a `BadInputError` with the command to install it."""
    try:
        yield
    except ModuleNotFoundError as error:
        raise BadInputError(
            f"there is no package '{error.name}': pip install 'humanoid-getup[{extra}]'"
        ) from error


@contextmanager
def refusing() -> Iterator[None]:
    """Convert errors of loaders about a user's input to `BadInputError`."""
    try:
        yield
    except BadInputError:
        raise
    except ValueError as error:
        raise BadInputError(str(error)) from error
    except OSError as error:
        if error.filename is None:  # not of a file that was named: a full disk
            raise
        raise BadInputError(f"{error.filename}: {error.strerror}") from error


@contextmanager
def refusing_own() -> Iterator[None]:
    """Convert a `ValueError` that one of our own `raise` statements raised to a `BadInputError`.

    One of a library is a fault of ours, and keeps its traceback.
    """
    try:
        yield
    except BadInputError:
        raise
    except ValueError as error:
        raised = error.__traceback__
        while raised is not None and raised.tb_next is not None:
            raised = raised.tb_next
        if raised is None or not _is_own_raise(raised.tb_frame, raised.tb_lasti):
            raise
        raise BadInputError(*getattr(error, "problems", [str(error)])) from error


def _is_own_raise(frame: FrameType, instruction: int) -> bool:
    package = str(frame.f_globals.get("__name__", "")).partition(".")[0]
    return package in OWN and frame.f_code.co_code[instruction] == RAISE
