"""The plan of a body: hinges by what they are, and sides that contradict each other."""

import copy
from dataclasses import replace

import numpy as np

from robots.body.body_plan import BodyPlan
from robots.body.roles import list_rising, list_segments


def names(small: BodyPlan, hinges: tuple[int, ...]) -> list[str]:
    return [small.joint_names[k].removesuffix("_joint") for k in hinges]


def test_limbs_are_listed_from_the_torso_on(small: BodyPlan):
    leg = ["hip_yaw", "hip_roll", "thigh", "shank", "ankle", "foot"]
    assert names(small, small.legs[0]) == [f"left_{part}" for part in leg]
    ((left, right),) = small.arms
    assert names(small, left) == ["left_shoulder", "left_upper_arm", "left_forearm"]
    assert names(small, right) == ["right_shoulder", "right_upper_arm", "right_forearm"]
    assert names(small, small.head) == ["head"]


def test_a_knee_that_bends_the_other_way_is_named(small: BodyPlan):
    model = copy.copy(small.model)
    knee = model.joint("left_shank_joint").id
    model.jnt_range[knee] = np.radians([-140.0, 0.0])
    (message,) = replace(small, model=model).find_contradictions()
    assert "left_shank_joint and right_shank_joint mirror each other, but not" in message
    assert "-140 to 0 deg and 0 to 140 deg" in message


def test_segments_are_head_feet_and_the_rest(small: BodyPlan):
    segments = list_segments(small, 0.0 * small.lower)
    by_name = dict(zip(small.joint_names, segments, strict=True))
    feet = {name for name, segment in by_name.items() if segment == "foot"}
    assert feet == {
        f"{side}_{part}_joint" for side in ("left", "right") for part in ("ankle", "foot")
    }
    assert by_name["head_joint"] == "head"
    assert by_name["left_shank_joint"] == "other"


def test_a_rise_moves_what_bends_legs_and_arms(small: BodyPlan):
    assert list_rising(small, 0.0 * small.lower) == tuple(
        f"left_{part}_joint"
        for part in ("shoulder", "upper_arm", "forearm", "thigh", "shank", "ankle")
    )
