"""Robots that stand where episodes begin."""

import mujoco
import numpy as np
import pytest

pytest.importorskip("gymnasium")

from robots.body.parts import find_arm_joints
from sim2real.environment.starts.stands import sample_stands


def test_stands_have_their_feet_at_home_and_their_arms_anywhere_but_in_the_robot(op3, world):
    stands = sample_stands(op3, world.model, 32, np.random.default_rng(0))
    joints = stands[:, op3.layout(world.model).qpos]
    arms = find_arm_joints(op3, world.model)
    assert np.array_equal(joints[:, ~arms], np.tile(op3.standing.joint_pos[~arms], (32, 1)))
    assert np.ptp(joints[:, arms], axis=0).min() > 1.0
    assert np.all((joints >= op3.lower) & (joints <= op3.upper))
    assert len({tuple(row) for row in joints}) > 25  # where an arm met the body, it is at home
    data = mujoco.MjData(world.model)
    for qpos in stands:
        data.qpos[:] = qpos
        mujoco.mj_forward(world.model, data)
        assert (world.model.geom_bodyid[data.contact.geom] == 0).any(axis=1).all()
