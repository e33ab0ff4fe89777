"""Frames of motions where episodes begin."""

import pytest

pytest.importorskip("gymnasium")

from robots import quaternion
from robots.kinematics import mirror_positions
from sim2real.environment.starts.motion_frames import (
    LEVELS,
    list_backward_starts,
    list_motion_starts,
)


def test_frames_of_the_known_motions_are_starts(op3, world):
    starts = list_motion_starts(op3, world.model)
    assert len(starts) > 100
    assert starts.shape[1] == world.model.nq
    root = op3.layout(world.model).root_qpos
    tilt = quaternion.tilt(starts[:, root + 3 : root + 7])
    assert tilt.min() < 0.1
    assert tilt.max() > 1.0


def test_backward_starts_are_higher_the_nearer_they_are_to_the_stand(op3, world):
    starts, levels = list_backward_starts(op3, world.model)
    assert sorted(set(levels.tolist())) == list(range(LEVELS))
    height = starts[:, op3.layout(world.model).root_qpos + 2]
    mean = [height[levels == level].mean() for level in range(LEVELS)]
    assert mean[:3] == sorted(mean[:3], reverse=True)
    assert mean[0] > 0.9 * op3.standing.position[2]
    assert mean[-1] < 0.5 * mean[0]
    count = len(starts) // 2
    assert starts[count:] == pytest.approx(mirror_positions(op3, world.model, starts[:count]))
