"""Key postures as goals of a search."""

from dataclasses import replace

import numpy as np
import pytest

from humanoid_getup.motions.motion_database import KeyPosture, label_key, load_key
from humanoid_getup.posture_chains.chain_search import ChainTools, SearchSettings
from humanoid_getup.posture_chains.key_goal import find_key_goal
from robots import quaternion


def test_a_posture_in_which_the_robot_does_not_rest_is_refused(op3, few_tools):
    tipped = quaternion.from_axis_angle(np.array([0.0, 1.0, 0.0]), 0.7)
    key = KeyPosture(name="tipped", posture=replace(op3.standing, orientation=tipped))
    with pytest.raises(ValueError, match="'tipped': robot 'op3' rests in it in 0 of 16"):
        find_key_goal(few_tools, key)


def test_another_posture_is_taken_where_the_robot_does_not_rest_in_the_first(op3, few_tools):
    tipped = quaternion.from_axis_angle(np.array([0.0, 1.0, 0.0]), 0.7)
    key = KeyPosture(
        name="any",
        posture=replace(op3.standing, orientation=tipped),
        others=(op3.standing,),
    )
    goal = find_key_goal(few_tools, key)
    assert not goal.touches
    assert goal.measure_neck(goal.qpos) > 0.95


def test_a_motion_can_be_named_after_a_posture():
    assert label_key("half-kneel") == "half_kneel"
    assert label_key("my/low squat.json") == "low_squat"


@pytest.mark.slow
def test_a_robot_gets_up_from_a_half_kneel(op3, world, few_moves):
    rng = np.random.default_rng(0)
    tools = ChainTools(world, rng, SearchSettings(threads=1), few_moves)
    goal = find_key_goal(tools, load_key("half-kneel", op3))
    assert goal.touches
    assert 0 < len(goal.onward) < 8
    assert np.allclose(goal.onward[-1].target, op3.standing.joint_pos)
