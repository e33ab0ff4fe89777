"""Mirror pairs: by place and axis, by name among equals, and signs."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robots.body.mirror_pairs import MirrorPairs, find_mirror

X, Y, Z = np.eye(3)


def pair(names: list[str], anchors: list, axes: list) -> MirrorPairs:
    points = np.array(anchors, dtype=float)
    return find_mirror(names, points, np.array(axes), points, [1] * len(names), 1.0)


@pytest.mark.parametrize(("axis", "sign"), [(X, -1.0), (Y, 1.0), (Z, -1.0)])
def test_equal_axes_turn_as_their_images_do(axis, sign: float):
    """By hand: a reflection in y = 0 keeps a turn about y and reverses those about x and z."""
    found = pair(["a", "b"], [[0, 0.1, 0], [0, -0.1, 0]], [axis, axis])
    assert found.index.tolist() == [1, 0]
    assert found.sign.tolist() == [sign, sign]


def test_what_has_no_image_or_is_in_the_middle_is_its_own_mirror():
    found = pair(["pan", "tilt", "l_lever"], [[0, 0, 0.5], [0, 0, 0.9], [0.1, 0.4, 0]], [Z, Y, Y])
    assert found.index.tolist() == [0, 1, 2]
    assert found.sign[:2].tolist() == [-1.0, 1.0]
    assert found.unpaired == (2,)


def test_hinges_at_one_place_are_paired_by_name_else_by_how_many_are_above_them():
    places = np.array([[0, 0.1, 0], [0, 0.1, 0], [0, -0.1, 0], [0, -0.1, 0]])
    assert pair(["l_a", "l_b", "r_b", "r_a"], [*places], [Y] * 4).index.tolist() == [3, 2, 1, 0]
    for depths, pairs in (([1, 2, 2, 1], [3, 2, 1, 0]), ([1, 2, 1, 2], [2, 3, 0, 1])):
        found = find_mirror(["a", "b", "c", "d"], places, np.array([Y] * 4), places, depths, 1.0)
        assert found.index.tolist() == pairs


@given(seed=st.integers(0, 1000))
def test_a_mirrored_body_is_paired_with_itself(seed: int):
    rng = np.random.default_rng(seed)
    left = rng.uniform([-0.5, 0.2, 0.0], [0.5, 0.9, 3.0], (3, 3))
    left[:, 2] += np.arange(3)
    axes = np.array([X, Y, Z])[rng.integers(0, 3, 3)]
    names = [f"joint_{k}" for k in range(6)]
    found = pair(names, [*left, *left * [1, -1, 1]], [*axes, *axes])
    assert found.index.tolist() == [3, 4, 5, 0, 1, 2]
