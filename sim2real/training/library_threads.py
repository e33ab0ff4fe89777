"""How many threads numpy and torch use: small arrays are faster on one than on all."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import torch
from threadpoolctl import ThreadpoolController


@contextmanager
def torch_threads(count: int) -> Iterator[None]:
    """Let torch use some threads."""
    usual = torch.get_num_threads()
    torch.set_num_threads(count)
    try:
        yield
    finally:
        torch.set_num_threads(usual)


@contextmanager
def numpy_threads(count: int) -> Iterator[None]:
    """Let numpy's linear algebra use some threads.

    Threads of OpenBLAS spin while they wait, which takes processor time from physics.
    """
    with ThreadpoolController().select(internal_api="openblas").limit(limits=count):
        yield
