"""How a job refuses what it was given."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager


class BadInputError(ValueError):
    """What the user gave cannot be used; the message names it and what is expected."""

    def __init__(self, *problems: str) -> None:
        super().__init__("; ".join(problems))
        self.problems = problems
        """Each is printed on a line of its own."""


@contextmanager
def needing(extra: str) -> Iterator[None]:
    """Turn the lack of an extra's packages into a `BadInputError` that says how to get them."""
    try:
        yield
    except ModuleNotFoundError as error:
        raise BadInputError(
            f"there is no package '{error.name}': pip install 'humanoid-getup[{extra}]'"
        ) from error


@contextmanager
def refusing() -> Iterator[None]:
    """Turn what a loader says about a user's input into a `BadInputError`."""
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
