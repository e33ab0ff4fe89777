"""Legs on a slope: soles flat under an upright body, and a policy that notices nothing."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from humanoid_getup.policy.observation import Sensed
from humanoid_getup.policy.slope_legs import SlopeLegs
from robots import Robot, load_robot, quaternion
from robots.kinematics import place
from robots.quaternion import Array

ANGLES = st.floats(-np.pi, np.pi)
OP3 = load_robot("op3")
LEGS = SlopeLegs(OP3, 1, np.radians([10.0, 20.0]))


def compute(slope: float, uphill: float, heading: float, neck: float = 1.0) -> Array:
    across = np.sin(slope) * np.array([np.cos(uphill), np.sin(uphill)])
    normal = np.array([[*-across, np.cos(slope)]])
    (shift,) = LEGS.compute(normal, quaternion.from_yaw([heading]), np.array([neck]))
    return shift


@given(slope=st.floats(0.0, np.radians(20.0)), uphill=ANGLES, heading=ANGLES)
def test_both_soles_of_an_upright_robot_are_flat_on_the_slope(slope, uphill, heading):
    stance = OP3.standing
    turned = quaternion.multiply(quaternion.from_yaw(heading), stance.orientation)
    joint_pos = stance.joint_pos + compute(slope, uphill, heading)
    model = OP3.spec().compile()
    data = mujoco.MjData(model)
    data.qpos[:] = place(OP3, model, replace(stance, orientation=turned, joint_pos=joint_pos))
    mujoco.mj_kinematics(model, data)
    wanted = [-np.sin(slope) * np.cos(uphill), -np.sin(slope) * np.sin(uphill), np.cos(slope)]
    for name in OP3.sole_sites:
        normal = data.site(name).xmat.reshape(3, 3)[:, 2]
        level = np.degrees(np.arccos(min(1.0, normal @ wanted)))
        assert level < 1.5 + 0.12 * np.degrees(slope)


@given(slope=st.floats(0.0, np.radians(20.0)), heading=ANGLES)
def test_the_mirror_image_of_a_heading_has_the_mirror_image_of_the_legs(slope, heading):
    other = OP3.mirror_joints(compute(slope, 0.0, heading))
    np.testing.assert_allclose(compute(slope, 0.0, -heading), other, atol=0.01)


def test_a_robot_that_lies_or_stands_on_level_ground_keeps_its_legs():
    assert not compute(np.radians(20.0), 0.0, 1.0, neck=0.5).any()
    assert not compute(0.0, 0.0, 1.0).any()
    assert np.abs(compute(np.radians(20.0), 0.0, 0.0)).max() > 0.3


def test_a_policy_measures_what_it_asked_for_wherever_the_ranges_allow(op3: Robot):
    legs = SlopeLegs(op3, 1, [np.radians(20.0)])
    wanted = compute(np.radians(20.0), 0.0, 0.0)[np.newaxis]
    legs.advance(wanted, 0.05)
    assert np.abs(legs.shift).max() == pytest.approx(3.0 * 0.05)  # 3 rad/s
    for _ in range(10):
        legs.advance(wanted, 0.05)
    target = op3.standing.joint_pos[np.newaxis]
    sensed = Sensed(
        gravity=-np.eye(3)[2:],
        gyro=np.zeros((1, 3)),
        joint_pos=legs.place(target),
        joint_vel=0.0 * target,
    )
    np.testing.assert_allclose(legs.level(sensed).joint_pos, target, atol=1e-12)
