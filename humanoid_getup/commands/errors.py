"""Errors of jobs: refusal of requests."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager


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
