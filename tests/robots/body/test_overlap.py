"""Self-overlap by pairs of links, against the ground truth of a twin."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from drivers import Twin
from humanoid_getup.simulation.world import World
from robots import Posture, Robot, quaternion
from robots.body.overlap import measure_pair_overlaps, overlaps_at
from robots.kinematics import place
from robots.quaternion import Array


def find(world: World, posture: Posture) -> Array:
    qpos = place(world.robot, world.model, posture)
    return overlaps_at(world.model, qpos, mujoco.MjData(world.model))


def cross(op3: Robot, seed: int) -> Posture:
    rng = np.random.default_rng(seed)
    return Posture(
        position=np.array([0.0, 0.0, 1.0]),
        orientation=quaternion.normalize(rng.normal(size=4)),
        joint_pos=rng.uniform(op3.lower, op3.upper),
    )


def deepest_by_hand(twin: Twin) -> float:
    """Look through the contacts one by one, for those of two bodies below the torso."""
    model, data = twin.truth.model, twin.truth.data
    own = [
        -float(contact.dist)
        for contact in data.contact
        if all(model.body_rootid[model.geom_bodyid[geom]] == 1 for geom in contact.geom)
    ]
    return max(own, default=0.0)


def test_the_deepest_pair_is_as_deep_as_the_robot_is_in_itself(world: World, op3: Robot):
    for seed in range(8):
        posture = cross(op3, seed)
        twin, depth = Twin(world, posture), find(world, posture)
        assert depth.max() == pytest.approx(twin.truth.self_penetration, abs=1e-12), seed
        assert depth.max() == pytest.approx(deepest_by_hand(twin), abs=1e-12), seed
        by_twin = measure_pair_overlaps(twin.truth.model, twin.truth.data)
        np.testing.assert_array_equal(depth, by_twin)
        np.testing.assert_array_equal(depth, np.triu(depth, k=1))


def test_overlap_is_of_the_links_that_cross_and_not_of_the_ground(world: World, op3: Robot):
    joint_pos = op3.standing.joint_pos.copy()
    in_the_ground = replace(op3.standing, position=np.zeros(3))
    assert find(world, in_the_ground).max() == 0.0
    joint_pos[op3.joint_names.index("l_hip_roll")] = 0.3
    joint_pos[op3.joint_names.index("r_hip_roll")] = -0.3
    depth = find(world, replace(in_the_ground, joint_pos=joint_pos))
    pairs = {tuple(world.model.body(link).name for link in pair) for pair in np.argwhere(depth)}
    assert pairs
    assert all(first.startswith("l_") and second.startswith("r_") for first, second in pairs)
