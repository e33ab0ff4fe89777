"""Threads of numpy and torch: small arrays are faster on one thread."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import torch
from threadpoolctl import ThreadpoolController


@contextmanager
def torch_threads(count: int) -> Iterator[None]:
    """Limit the threads of torch within a block."""
    usual = torch.get_num_threads()
    torch.set_num_threads(count)
    try:
        yield
    finally:
        torch.set_num_threads(usual)


@contextmanager
def numpy_threads(count: int) -> Iterator[None]:
    """Limit the threads of numpy's linear algebra within a block.

    Threads of OpenBLAS spin while they wait, which takes processor time from physics.
    """
    with ThreadpoolController().select(internal_api="openblas").limit(limits=count):
        yield
