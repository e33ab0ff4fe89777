"""Trajectories of ROS: what a file says, as keys of a robot."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from humanoid_getup.motions.importing.imported_keyframes import load_sequences
from humanoid_getup.motions.importing.key_sequence import MOST_KEYS
from humanoid_getup.motions.importing.trajectory_file import CLOSE, choose_keys
from robots import Robot

ECHOED = """header:
  stamp:
    sec: 12
    nanosec: 5
  frame_id: ''
joint_names:
- r_hip
- l_hip
points:
- positions:
  - 0.5
  - 1
  velocities: []
  accelerations: []
  effort: []
  time_from_start:
    sec: 1
    nanosec: 500000000
- positions: [0.0, 0.25]
  time_from_start: {sec: 3, nanosec: 0}
---
"""


def test_a_message_as_ros_prints_it_is_read(tmp_path: Path, tiny: Robot):
    pytest.importorskip("yaml")
    path = tmp_path / "wave.yaml"
    path.write_text(ECHOED)
    (sequence,) = load_sequences(path, (), tiny)
    assert tiny.joint_names == ("l_hip", "r_hip")
    np.testing.assert_allclose(sequence.keys, [[1.0, 0.5], [0.25, 0.0]])
    np.testing.assert_allclose(sequence.after, [1.5])
    assert (sequence.name, sequence.notes) == ("wave", ())


@given(
    st.lists(st.integers(1, 50), min_size=1, max_size=80),
    st.integers(0, 2**32 - 1),
)
def test_the_chosen_points_are_close_to_all_or_as_many_as_keys_may_be(steps: list[int], seed: int):
    time = np.cumsum(steps) * 0.01
    positions = np.random.default_rng(seed).normal(size=(len(time), 2))
    kept, distance = choose_keys(time, positions)
    assert kept == sorted(set(kept))
    assert {0, len(time) - 1} <= set(kept)
    assert distance <= CLOSE or len(kept) == MOST_KEYS
