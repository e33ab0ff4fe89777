"""Blossoms: one step straight ahead, the others around it, none longer than a step."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from humanoid_getup.planning.blossom import SPAN, blossom

VECTORS = st.lists(st.floats(-3.0, 3.0), min_size=3, max_size=3).map(np.array)


@settings(max_examples=50)
@given(origin=VECTORS, way=VECTORS, step=st.floats(0.1, 5.0), seed=st.integers(0, 9))
def test_the_first_step_is_straight_and_none_leads_beyond_its_length(origin, way, step, seed):
    steps = blossom(origin, way, step, 5, np.random.default_rng(seed)) - origin
    length = np.linalg.norm(way)
    reach = min(step, length)
    np.testing.assert_allclose(np.linalg.norm(steps, axis=1), reach, atol=1e-9)
    if length > 1e-6:
        np.testing.assert_allclose(steps[0], way / length * reach, atol=1e-9)


def test_around_the_way_each_direction_is_within_the_span():
    way = np.array([2.0, 0.0])
    steps = blossom(np.zeros(2), way, 1.0, 500, np.random.default_rng(0))
    angle = np.arctan2(steps[:, 1], steps[:, 0])
    largest = np.arctan2(np.tan(SPAN), 1.0 - np.tan(SPAN))
    assert angle[0] == 0.0
    assert 0.5 * SPAN < np.abs(angle).max() <= largest
