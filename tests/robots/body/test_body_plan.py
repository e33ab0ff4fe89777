"""The plan of a body: hinges by what they are, and sides that contradict each other."""

from robots.body.body_plan import BodyPlan, list_rising, list_segments


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
