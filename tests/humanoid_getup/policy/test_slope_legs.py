"""Legs on a slope: soles flat under an upright body, and a policy that notices nothing."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from humanoid_getup.policy.observation import Sensed
from humanoid_getup.policy.slope_legs import SlopeLegs
from robots import load_robot, quaternion
from robots.kinematics import place
from robots.quaternion import Array

HEADING = st.floats(-np.pi, np.pi)
OP3 = load_robot("op3")
MODEL = OP3.spec().compile()
UPHILL, DOWNHILL = (SlopeLegs(OP3, 1, np.radians(angle)) for angle in (20.0, -20.0))


def compute(heading: float, neck: float = 1.0, legs: SlopeLegs = UPHILL) -> Array:
    return legs.compute(quaternion.from_yaw(np.array([heading])), np.array([neck]))[0]


@given(heading=HEADING)
def test_both_soles_of_an_upright_robot_are_flat_on_the_slope(heading):
    stance, data = OP3.standing, mujoco.MjData(MODEL)
    orientation = quaternion.multiply(quaternion.from_yaw(heading), stance.orientation)
    joint_pos = stance.joint_pos + compute(heading)
    data.qpos[:] = place(OP3, MODEL, replace(stance, orientation=orientation, joint_pos=joint_pos))
    mujoco.mj_kinematics(MODEL, data)
    wanted = np.array([-np.sin(np.radians(20.0)), 0.0, np.cos(np.radians(20.0))])
    for name in OP3.sole_sites:
        normal = data.site(name).xmat.reshape(3, 3)[:, 2]
        assert np.degrees(np.arccos(min(1.0, normal @ wanted))) < 4.0


@given(heading=HEADING)
def test_the_mirror_image_of_a_heading_has_the_mirror_image_of_the_legs(heading):
    mirrored = OP3.mirror_joints(compute(heading))
    np.testing.assert_allclose(compute(-heading), mirrored, atol=0.01)
    turned = np.angle(np.exp(1j * (heading + np.pi)))  # a slope that falls along +x
    np.testing.assert_allclose(compute(turned, legs=DOWNHILL), compute(heading), atol=0.01)


def test_a_robot_that_lies_keeps_its_legs():
    assert np.abs(compute(0.0)).max() > 0.3
    assert not compute(0.0, neck=0.5).any()
    prone = quaternion.from_axis_angle(np.array([[0.0, 1.0, 0.0]]), np.array([0.5 * np.pi]))
    assert not UPHILL.compute(prone, np.ones(1)).any()


def test_a_policy_measures_what_it_asked_for_and_no_target_is_too_fast():
    legs, wanted = SlopeLegs(OP3, 1, np.radians(20.0)), compute(0.0)[np.newaxis]
    target, reach = OP3.standing.joint_pos[np.newaxis], np.full(OP3.n, 0.2)
    before, after = legs.send(target, target, wanted, reach, 0.05)
    assert np.abs(after - before).max() == pytest.approx(3.0 * 0.05)  # 3 rad/s
    before, after = legs.send(target, target + 0.19 * np.sign(wanted), wanted, reach, 0.05)
    assert np.abs(after - before).max() == pytest.approx(0.2)
    for _ in range(10):
        legs.send(target, target, wanted, reach, 0.05)
    np.testing.assert_allclose(legs.shift, wanted)
    still = np.zeros((1, 3))
    sensed = Sensed(gravity=still, gyro=still, joint_pos=legs.place(target), joint_vel=0.0 * target)
    np.testing.assert_allclose(legs.level(sensed).joint_pos, target, atol=1e-12)
    assert (legs.place(OP3.upper[np.newaxis]) <= OP3.upper).all()
