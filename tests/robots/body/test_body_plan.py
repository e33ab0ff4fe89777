"""The plan of a body: hinges by what they are, and sides that contradict each other."""

from robots.body.body_plan import BodyPlan, list_rising, list_segments


def test_segments_are_head_feet_and_the_rest_and_a_rise_moves_what_bends_limbs(small: BodyPlan):
    segments = list_segments(small, 0.0 * small.lower)
    by_name = dict(zip(small.joint_names, segments, strict=True))
    feet = {name for name, segment in by_name.items() if segment == "foot"}
    assert feet == {f"{s}_{p}_joint" for s in ("left", "right") for p in ("ankle", "foot")}
    assert by_name["head_joint"] == "head"
    assert by_name["left_shank_joint"] == "other"
    parts = ("shoulder", "upper_arm", "forearm", "thigh", "shank", "ankle")
    assert list_rising(small, 0.0 * small.lower) == tuple(f"left_{part}_joint" for part in parts)
