"""Robots that stand where episodes begin."""

import mujoco
import numpy as np
import pytest

pytest.importorskip("gymnasium")

from humanoid_getup.scenes.scene import FLAT_SCENE
from robots import load_robot
from robots.body.parts import find_arm_joints
from robots.kinematics import place
from sim2real.environment.env_options import PHYSICS_STEP
from sim2real.environment.physics.training_world import build_training_world
from sim2real.environment.starts.stands import sample_stands


def test_op3s_arms_are_what_no_foot_hangs_on(op3, world):
    arms = {
        name
        for name, arm in zip(op3.joint_names, find_arm_joints(op3, world.model), strict=True)
        if arm
    }
    assert arms == {f"{side}_{name}" for side in "lr" for name in ("sho_pitch", "sho_roll", "el")}


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


def test_who_has_no_arms_stands_as_described():
    tiny = load_robot("tests/robots/tiny")
    model = build_training_world(tiny, FLAT_SCENE, PHYSICS_STEP).model
    stands = sample_stands(tiny, model, 4, np.random.default_rng(0))
    assert np.array_equal(stands, np.tile(place(tiny, model, tiny.standing), (4, 1)))
