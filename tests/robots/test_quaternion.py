"""Quaternions, against rotation matrices as MuJoCo makes them, and the smooth step."""

import math

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robots import quaternion
from robots.smooth_step import smooth_step

numbers = st.floats(-1.0, 1.0)
quaternions = (
    st.tuples(numbers, numbers, numbers, numbers)
    .filter(lambda q: np.linalg.norm(q) > 0.1)
    .map(lambda q: quaternion.normalize(np.array(q)))
)


def matrix(q):
    R = np.zeros(9)
    mujoco.mju_quat2Mat(R, q)
    return R.reshape(3, 3)


@given(p=quaternions, q=quaternions)
def test_products_are_those_of_matrices(p, q):
    assert matrix(quaternion.multiply(p, q)) == pytest.approx(matrix(p) @ matrix(q), abs=1e-9)


@given(p=quaternions, q=quaternions, t=st.floats(0.0, 1.0))
def test_slerp_goes_evenly_along_the_shorter_arc(p, q, t):
    whole = quaternion.angle_between(p, q)
    middle = quaternion.slerp(p, q, t)
    assert quaternion.angle_between(p, middle) == pytest.approx(t * whole, abs=1e-6)
    assert quaternion.angle_between(middle, q) == pytest.approx((1.0 - t) * whole, abs=1e-6)


@given(q=quaternions)
def test_mirroring_conjugates_with_the_reflection(q):
    M = np.diag([1.0, -1.0, 1.0])
    assert matrix(quaternion.mirror(q)) == pytest.approx(M @ matrix(q) @ M, abs=1e-9)
    assert np.array_equal(quaternion.mirror(quaternion.mirror(q)), q)


@given(q=quaternions, yaw=st.floats(-3.0, 3.0))
def test_gravity_and_tilt_do_not_know_the_yaw(q, yaw):
    turned = quaternion.multiply(quaternion.from_yaw(yaw), q)
    assert quaternion.gravity_in_body(turned) == pytest.approx(
        quaternion.gravity_in_body(q), abs=1e-9
    )
    assert quaternion.tilt(q) == pytest.approx(math.acos(np.clip(matrix(q)[2, 2], -1, 1)), abs=1e-6)


SHARES = st.floats(-1.0, 2.0)


@given(first=SHARES, second=SHARES)
def test_it_rises_from_0_to_1_and_is_the_same_from_both_sides(first: float, second: float):
    low, high = smooth_step(np.sort([first, second]))
    assert 0.0 <= low <= high + 1e-15 <= 1.0 + 1e-15
    assert smooth_step(np.array([first, 1.0 - first])).sum() == pytest.approx(1.0)


def test_it_leaves_and_arrives_at_rest():
    step = 1e-4
    left, right = smooth_step(np.array([step, 1.0 - step]))
    assert left / step == pytest.approx(0.0, abs=1e-3)
    assert (1.0 - right) / step == pytest.approx(0.0, abs=1e-3)
    assert smooth_step(np.array(0.5)) == 0.5
