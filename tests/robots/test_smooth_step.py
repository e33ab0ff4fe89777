"""The smooth step: level at both ends, the same from both sides."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robots.smooth_step import smooth_step

SHARES = st.floats(-1.0, 2.0)


@given(first=SHARES, second=SHARES)
def test_it_rises_from_0_to_1_and_is_the_same_from_both_sides(first: float, second: float):
    low, high = smooth_step(np.sort([first, second]))
    assert 0.0 <= low <= high + 1e-15 <= 1.0 + 1e-15
    assert smooth_step(np.array([first, 1.0 - first])).sum() == pytest.approx(1.0)


def test_it_leaves_and_arrives_at_rest():
    step = 1e-4
    left, right = smooth_step(np.array([step, 1.0 - step]))
    assert left / step == pytest.approx(0.0, abs=1e-3)
    assert (1.0 - right) / step == pytest.approx(0.0, abs=1e-3)
    assert smooth_step(np.array(0.5)) == 0.5
