"""A view of joints: anchors, axes and ends of limbs in the torso's frame, and their kinds."""

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robots.body.joint_view import JointView, LimbEnds
from robots.body.limbs import Leg
from robots.body.parts import gather_links
from robots.body.squats import FlatSoles, Foot
from robots.model_import.body_plan import BodyPlan, list_rising, list_segments

MODEL = """<mujoco><worldbody><body pos="0 0 1"><freejoint/><geom size="0.1"/>
  <body><joint name="elbow" axis="0 1 0"/>{forearm}</body>
</body></worldbody></mujoco>"""
ROD = '<geom type="capsule" fromto="0 0 0 0 0 -0.2" size="0.01" mass="1"/>'


def end_of(forearm: str, angle: float = 0.0) -> np.ndarray:
    model = mujoco.MjModel.from_xml_string(MODEL.format(forearm=forearm))
    data = mujoco.MjData(model)
    data.qpos[7] = angle
    mujoco.mj_forward(model, data)
    return LimbEnds(model).locate(data, model.joint("elbow").id)


@pytest.mark.parametrize(
    ("forearm", "reach"),
    [
        (ROD, 0.21),
        ('<geom type="box" size="0.02 0.03 0.1" pos="0 0 -0.1"/>', 0.2),
        # As OP2's: a servo beside the elbow is heavy, and a hand light.
        (f'{ROD}<geom size="0.02" pos="0.02 0 0" mass="9"/>', 0.21),
        (f'{ROD}<body><geom size="0.02" pos="0 0 -0.2" mass="1e-6"/></body>', 0.22),
        (f'{ROD}<body><joint/><geom size="0.02" pos="0 0 -0.3"/></body>', 0.32),
        ('<geom size="0.1"/>', 0.0),  # around the joint: it has no end
        # No shape at all: it ends at its mass.
        ('<inertial pos="0 0 -0.1" mass="1" diaginertia="1 1 1"/>', 0.1),
    ],
    ids=["rod", "box", "heavy elbow", "welded hand", "hand on a joint", "ball", "mass alone"],
)
def test_a_limb_ends_in_the_middle_of_its_far_end(forearm: str, reach: float):
    assert end_of(forearm) == pytest.approx([0.0, 0.0, 1.0 - reach], abs=1e-4)


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


def test_joints_twist_along_their_limb_or_pitch_about_y(small: BodyPlan):
    view, down, leg = looked(small), np.array([0.0, 0.0, -0.3]), small.legs[0]
    assert view.twists(place(small, "left_hip_yaw"), down)
    assert not view.twists(place(small, "left_thigh"), down)
    assert not view.twists(place(small, "left_hip_yaw"), np.zeros(3))
    pitch = [small.joint_names[k] for k in view.list_pitch(leg)]
    assert pitch == ["left_thigh_joint", "left_shank_joint", "left_ankle_joint"]
    assert looked(small, left_hip_roll=1.0).list_pitch(leg) == []


def test_segments_are_head_feet_and_the_rest_and_a_rise_moves_what_bends_limbs(small: BodyPlan):
    segments = list_segments(small, 0.0 * small.lower)
    by_name = dict(zip(small.joint_names, segments, strict=True))
    feet = {name for name, segment in by_name.items() if segment == "foot"}
    assert feet == {f"{s}_{p}_joint" for s in ("left", "right") for p in ("ankle", "foot")}
    assert by_name["head_joint"] == "head"
    assert by_name["left_shank_joint"] == "other"
    parts = ("shoulder", "upper_arm", "forearm", "thigh", "shank", "ankle")
    assert list_rising(small, 0.0 * small.lower) == tuple(f"left_{part}_joint" for part in parts)


WELDED = """<mujoco><worldbody><body name="torso"><freejoint/><geom size="0.1"/>
  <body name="pack"><geom size="0.1"/><site name="badge"/><body name="flap">
    <joint pos="0 0 0.02" axis="1 0 0"/><geom size="0.1"/></body></body>
</body></worldbody></mujoco>"""


def test_a_link_has_what_is_welded_to_it_and_is_anchored_at_its_joint():
    model = mujoco.MjModel.from_xml_string(WELDED)
    torso = gather_links(model, model.body("torso").id)
    assert [model.body(body).name for body in torso.bodies] == ["torso", "pack"]
    assert (len(torso.geoms), len(torso.sites), torso.anchor().tolist()) == (2, 1, [0.0] * 3)
    (flap,) = torso.children
    assert flap.anchor().tolist() == [0.0, 0.0, 0.02]


def test_a_foot_in_front_of_the_other_is_off_by_the_stride(small: BodyPlan):
    looked(small)
    pairs = zip(small.legs, small.soles, strict=True)
    legs = [Leg(small.view, joints, small.model.site(sole).id) for joints, sole in pairs]
    feet = [Foot.stand(leg) for leg in legs]
    soles = FlatSoles(view=small.view, feet=feet, length=0.3, stride=0.06)
    _, errors = soles.measure(0.3)  # parallel soles, each in place, stride, balance
    assert errors[:12] == pytest.approx([*np.zeros(11), -0.06 / 0.3], abs=1e-9)
