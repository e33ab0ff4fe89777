"""The posture metric is a metric, and it does not see where the robot faces."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mirror_images import mirror_posture

from humanoid_getup.motions.posture_metric import (
    SEGMENT_WEIGHT,
    PostureMetric,
    align,
    aligned_orientation_distance,
    best_yaw,
)
from robots import Posture, load_robot, quaternion

ROBOT = load_robot("op3")
METRIC = PostureMetric.of(ROBOT)

seeds = st.integers(0, 2**32 - 1)
angles = st.floats(-np.pi, np.pi)


def postures(seed: int, count: int) -> list[Posture]:
    rng = np.random.default_rng(seed)
    return [
        Posture(
            position=rng.normal(size=3),
            orientation=quaternion.normalize(rng.normal(size=4)),
            joint_pos=rng.uniform(ROBOT.lower, ROBOT.upper),
        )
        for _ in range(count)
    ]


def turned(posture: Posture, yaw: float) -> Posture:
    turn = quaternion.from_yaw(yaw)
    return replace(posture, orientation=quaternion.multiply(turn, posture.orientation))


@given(seeds)
def test_distance_is_symmetric_positive_and_obeys_the_triangle(seed: int):
    """Mirror images are as far apart as their originals."""
    a, b, c = postures(seed, 3)
    assert abs(METRIC.between(a, b) - METRIC.between(b, a)) < 1e-9
    assert METRIC.between(a, b) > 0.0
    assert METRIC.between(a, c) <= METRIC.between(a, b) + METRIC.between(b, c) + 1e-9
    mirrored = METRIC.between(mirror_posture(ROBOT, a), mirror_posture(ROBOT, b))
    assert abs(mirrored - METRIC.between(a, b)) < 1e-9


@given(seeds, angles)
def test_turning_and_shifting_on_the_ground_changes_nothing(seed: int, yaw: float):
    a, b = postures(seed, 2)
    moved = replace(turned(b, yaw), position=np.zeros(3))
    assert abs(METRIC.between(a, moved) - METRIC.between(a, b)) < 1e-9
    assert METRIC.between(a, turned(a, yaw)) < 1e-6
    negated = replace(b, orientation=-b.orientation)
    assert abs(METRIC.between(a, negated) - METRIC.between(a, b)) < 1e-9


def test_no_yaw_of_a_fine_search_beats_the_closed_form():
    yaws = np.linspace(-np.pi, np.pi, 20001)
    for seed in range(20):
        a, b = postures(seed, 2)
        q = quaternion.multiply(quaternion.from_yaw(yaws), b.orientation)
        tried = 0.5 * quaternion.angle_between(a.orientation, q)
        found = aligned_orientation_distance(a.orientation, b.orientation)
        assert 0.0 <= tried.min() - found < 1e-7
        best = best_yaw(b.orientation, a.orientation)
        assert abs(np.angle(np.exp(1j * (yaws[tried.argmin()] - best)))) < 1e-3


def test_the_distance_worked_out_by_hand():
    # Knee (weight 1) off by 0.3, head pan (0.5) by 0.4, tilted by 0.2 rad:
    # 5 * 0.1 + sqrt(0.3^2 + 0.5 * 0.4^2) = 0.5 + sqrt(0.17)
    a = ROBOT.standing
    joint_pos = a.joint_pos.copy()
    joint_pos[ROBOT.joint_names.index("l_knee")] += 0.3
    joint_pos[ROBOT.joint_names.index("head_pan")] += 0.4
    tilt = quaternion.from_axis_angle(np.array([1.0, 0.0, 0.0]), 0.2)
    b = replace(a, orientation=quaternion.multiply(tilt, a.orientation), joint_pos=joint_pos)
    assert abs(METRIC.between(a, b) - (0.5 + np.sqrt(0.17))) < 1e-9


def test_a_segment_weighs_what_the_paper_says():
    """[Lin12], section 5: a foot 0.7, the head 0.5, other segments of this robot 1."""
    a = ROBOT.standing
    weights = {"l_ank_pitch": 0.7, "r_ank_roll": 0.7, "head_tilt": 0.5, "r_knee": 1.0}
    for joint, weight in weights.items():
        joint_pos = a.joint_pos.copy()
        joint_pos[ROBOT.joint_names.index(joint)] += 0.3
        distance = METRIC.between(a, replace(a, joint_pos=joint_pos))
        assert distance == pytest.approx(np.sqrt(weight) * 0.3, abs=1e-12)
    names = ("wrist", "hand", "finger", "thumb", "toes")
    assert [SEGMENT_WEIGHT[name] for name in names] == [0.5, 0.3, 0.1, 0.1, 0.1]


@given(seeds)
def test_an_aligned_posture_is_turned_by_the_best_yaw_and_keeps_its_height(seed: int):
    a, b = postures(seed, 2)
    aligned = align(b, a)
    np.testing.assert_allclose(aligned.position, [*a.position[:2], b.position[2]])
    left = 0.5 * quaternion.angle_between(a.orientation, aligned.orientation)
    assert abs(left - aligned_orientation_distance(a.orientation, b.orientation)) < 1e-9
    np.testing.assert_allclose(aligned.gravity_b, b.gravity_b, atol=1e-9)
