"""Names that say a side: found, swapped, removed, whatever the habit of spelling."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robots.body.side_names import remove_side, side_of, swap_side

PAIRS = [
    ("l_knee", "r_knee", "knee"),
    ("left_hip_pitch", "right_hip_pitch", "hip_pitch"),
    ("hip_pitch_left", "hip_pitch_right", "hip_pitch"),
    ("LHipPitch", "RHipPitch", "HipPitch"),
    ("hipPitchL", "hipPitchR", "hipPitch"),
    ("LeftAnkle-roll", "RightAnkle-roll", "Ankle-roll"),
    ("left.wrist2", "right.wrist2", "wrist2"),
]


@pytest.mark.parametrize(("left", "right", "bare"), PAIRS)
def test_a_pair_is_recognized_by_its_names(left: str, right: str, bare: str):
    assert (swap_side(left), swap_side(right)) == (right, left)
    assert (side_of(left), side_of(right)) == (1, -1)
    assert remove_side(left, right) == remove_side(right, left) == bare


@given(
    words=st.lists(st.sampled_from(["hip", "knee", "roll", "link", "2"]), min_size=1, max_size=4),
    side=st.sampled_from(["l", "r", "left", "right", "L", "R", "Left", "RIGHT"]),
    separator=st.sampled_from(["_", "-", "."]),
)
def test_swapping_twice_gives_the_name_back(words: list[str], side: str, separator: str):
    name = separator.join([side, *words])
    assert swap_side(swap_side(name)) == name != swap_side(name)
    assert side_of(swap_side(name)) == -side_of(name)
