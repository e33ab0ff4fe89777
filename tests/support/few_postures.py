"""Searches over postures that begin with few of them: to draw and try all takes 20 s."""

from collections.abc import Iterator
from contextlib import contextmanager
from unittest.mock import patch

import pytest

from humanoid_getup.posture_chains import moves

COUNT = 6  # crouches, and as many props, that are drawn


@contextmanager
def drawing_few() -> Iterator[None]:
    """Let moves be made with few crouches and props while the block runs."""
    with patch.object(moves, "CROUCHES", COUNT), patch.object(moves, "PROPS", COUNT):
        yield


@pytest.fixture(scope="module")
def few_postures() -> Iterator[None]:
    """Let all moves of a file of tests be made with few crouches and props."""
    with drawing_few():
        yield
