"""Threads are limited within a block, whatever ends it."""

import contextlib

import pytest

torch = pytest.importorskip("torch")
pytest.importorskip("threadpoolctl")

import numpy as np
from threadpoolctl import threadpool_info

from sim2real.training.library_threads import numpy_threads, torch_threads


def count_numpy_threads() -> list[int]:
    np.ones((2, 2)) @ np.ones((2, 2))  # loads OpenBLAS
    return [row["num_threads"] for row in threadpool_info() if row["internal_api"] == "openblas"]


def test_torch_has_its_threads_again_after_a_block_that_raises():
    usual = torch.get_num_threads()
    with contextlib.suppress(ZeroDivisionError), torch_threads(usual + 1):
        assert torch.get_num_threads() == usual + 1
        raise ZeroDivisionError
    assert torch.get_num_threads() == usual


def test_numpy_has_one_thread_within_a_block():
    usual = count_numpy_threads()
    with numpy_threads(1):
        assert set(count_numpy_threads()) <= {1}
    assert count_numpy_threads() == usual
