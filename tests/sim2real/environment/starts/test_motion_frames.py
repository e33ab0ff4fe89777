"""Frames of motions where episodes begin."""

import pytest

pytest.importorskip("gymnasium")

from robots import quaternion
from sim2real.environment.starts.motion_frames import list_motion_starts


def test_frames_of_the_known_motions_are_starts(op3, world):
    starts = list_motion_starts(op3, world.model)
    assert len(starts) > 100
    assert starts.shape[1] == world.model.nq
    root = op3.layout(world.model).root_qpos
    tilt = quaternion.tilt(starts[:, root + 3 : root + 7])
    assert tilt.min() < 0.1
    assert tilt.max() > 1.0
