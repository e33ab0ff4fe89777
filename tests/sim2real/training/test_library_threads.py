"""Threads are limited within a block, whatever ends it."""

import contextlib
import os
import subprocess
import sys

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


@pytest.mark.parametrize(("own", "expected"), [(None, "PASSIVE"), ("ACTIVE", "ACTIVE")])
def test_idle_threads_of_torch_sleep_unless_the_user_wants_otherwise(own, expected):
    """OpenMP reads the variable when torch is imported, so that it has to be set before."""
    environment = {name: value for name, value in os.environ.items() if name != "OMP_WAIT_POLICY"}
    environment |= {"OMP_WAIT_POLICY": own} if own else {}
    done = subprocess.run(
        [sys.executable, "-c", AT_TORCH],
        capture_output=True,
        text=True,
        env=environment,
        check=True,
    )
    assert done.stdout.split() == [expected]


AT_TORCH = """
import os, sys
from pathlib import Path
from humanoid_getup.jobs.errors import BadInputError
from humanoid_getup.jobs.requests.learning import TrainRequest
from humanoid_getup.jobs.train_policy import train

class Watch:
    def find_spec(self, name, *_):
        if name == "torch":
            print(os.environ["OMP_WAIT_POLICY"])

sys.meta_path.insert(0, Watch())
try:
    train(TrainRequest(out=Path("never"), device="none"))
except BadInputError:
    pass
"""
