"""Ties: the rows of a model's constraints, by hand, and their grouping."""

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robots.model_import.ties import Tie, group_ties, list_ties

MODEL = """<mujoco>
  <compiler angle="radian"/>
  <worldbody><body name="base"><freejoint/><geom size="0.1"/>
    <body><joint name="a"/><geom size="0.1"/></body>
    <body><joint name="b"/><geom size="0.1"/></body>
    <body><joint name="c"/><geom size="0.1"/></body>
  </body></worldbody>
  <equality><joint joint1="b" joint2="a" polycoef="0 -2 0 0 0"/></equality>
  <tendon><fixed limited="true" range="-RANGE RANGE">
    <joint joint="a" coef="1"/><joint joint="c" coef="0.5"/></fixed></tendon>
</mujoco>"""
NAMES = st.lists(st.sampled_from("abcdefgh"), min_size=1, max_size=3, unique=True)


def list_of(text: str) -> list[Tie]:
    model = mujoco.MjModel.from_xml_string(text)
    return list_ties(model, model.qpos0)


def test_gears_and_tight_tendons_tie_hinges_by_their_ratios():
    gear, tendon = list_of(MODEL.replace("RANGE", "0.04"))
    assert (gear.joints, tendon.joints) == (("a", "b"), ("a", "c"))
    assert np.array(gear.shares) / gear.shares[0] == pytest.approx([1.0, 0.5])  # b + 2 a
    assert tendon == Tie(("a", "c"), (1.0, 0.5))
    assert not gear.is_loop


@given(st.lists(NAMES, max_size=8))
def test_groups_share_no_hinge_and_none_can_be_split(sets: list[list[str]]):
    ties = [Tie(tuple(names), (1.0,) * len(names)) for names in sets]
    groups = list(group_ties(ties))
    assert sorted(tie.joints for group in groups for tie in group) == sorted(map(tuple, sets))
    members = [set().union(*(tie.joints for tie in group)) for group in groups]
    assert len(set().union(*members)) == sum(map(len, members))
    for group in groups:  # each is reached from its first tie
        reached = {*group[0].joints}
        for _ in group:
            reached |= set().union(*(t.joints for t in group if reached & {*t.joints}))
        assert reached == set().union(*(tie.joints for tie in group))
