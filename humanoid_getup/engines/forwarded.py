"""Futures of other engines as futures of ours: with their results, and with our errors."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from contextlib import suppress
from typing import TypeVar

Result = TypeVar("Result")


def forward(
    inner: Future[Result], translate: Callable[[BaseException], BaseException]
) -> Future[Result]:
    """Return a future that ends as another one does, with a translated error."""
    outer = Future[Result]()
    outer.set_running_or_notify_cancel()

    def end(done: Future[Result]) -> None:
        with suppress(Exception):  # it was cancelled meanwhile
            if done.cancelled():
                outer.cancel()
            elif (error := done.exception()) is not None:
                outer.set_exception(translate(error))
            else:
                outer.set_result(done.result())

    inner.add_done_callback(end)
    return outer
