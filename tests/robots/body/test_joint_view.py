"""A view of joints: anchors, axes and ends at joint angles, in the torso's frame."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robots.body.body_plan import BodyPlan
from robots.body.joint_view import JointView


def place(small: BodyPlan, name: str) -> int:
    return small.joint_names.index(f"{name}_joint")


def looked(small: BodyPlan, **angles: float) -> JointView:
    """Look at angles by joint [rad], all others at 0."""
    values = np.zeros(len(small.joint_names))
    for name, angle in angles.items():
        values[place(small, name)] = angle
    small.view.look(values)
    return small.view


@given(angle=st.floats(-1.5, 0.0))
def test_an_anchor_swings_about_the_joint_above(small: BodyPlan, angle: float):
    """By hand: a thigh of 14 cm that swings forward about y."""
    view = looked(small, left_thigh=angle)
    knee = [-0.14 * np.sin(angle), 0.05, -0.14 * np.cos(angle)]
    assert view.anchor(place(small, "left_shank")) == pytest.approx(knee)


def test_a_joint_along_its_limb_only_twists_it(small: BodyPlan):
    view, down = looked(small), np.array([0.0, 0.0, -0.3])
    assert view.twists(place(small, "left_hip_yaw"), down)
    assert not view.twists(place(small, "left_thigh"), down)
    assert not view.twists(place(small, "left_hip_yaw"), np.zeros(3))


def test_pitch_joints_are_those_about_y_as_they_stand(small: BodyPlan):
    leg = small.legs[0]
    pitch = [small.joint_names[k] for k in looked(small).list_pitch(leg)]
    assert pitch == ["left_thigh_joint", "left_shank_joint", "left_ankle_joint"]
    rolled = looked(small, left_hip_roll=1.0)
    assert rolled.list_pitch(leg) == []
