"""Lying down: on the side that was meant, still at the end, and never faster than a knock."""

from itertools import product

import numpy as np
import pytest
from nonempty import nonempty
from records import make_record

from humanoid_getup.experiments.judging.lying import (
    GRAVITY_B,
    MAX_DESCENT,
    MAX_LEAN,
    MAX_SWAY,
    judge_lying,
    measure_lying,
)
from robots import Robot, quaternion

PERIOD = 0.01
SAMPLES = 400
SIDES = {
    "supine": (np.array([0.0, 1.0, 0.0]), -np.pi / 2),
    "prone": (np.array([0.0, 1.0, 0.0]), np.pi / 2),
    "left": (np.array([1.0, 0.0, 0.0]), -np.pi / 2),
    "right": (np.array([1.0, 0.0, 0.0]), np.pi / 2),
}


def record(side="supine", off=0.0, moved=0.0, speed=0.1):
    """A robot that turns by a quarter, sinks at a speed [m/s], and lies for the second half."""
    axis, quarter = SIDES[side]
    share = np.clip(2.0 * np.arange(SAMPLES) / SAMPLES, 0.0, 1.0)
    orientation = quaternion.from_axis_angle(axis, share * (quarter - np.sign(quarter) * off))
    joint_pos = np.zeros((SAMPLES, 3))
    joint_pos[-1, 1] = moved
    neck = 0.3 - speed * PERIOD * np.minimum(np.arange(SAMPLES), SAMPLES // 2)
    return orientation, joint_pos, neck, PERIOD


def test_a_robot_lies_on_its_side_and_on_no_other():
    for side, other in nonempty(product(SIDES, SIDES)):
        assert bool(judge_lying(*record(side), other).lies) == (side == other), (side, other)


@pytest.mark.parametrize(
    ("changes", "lies"),
    [
        ({"off": 0.95 * MAX_LEAN}, True),
        ({"off": 1.05 * MAX_LEAN}, False),  # leans on its arms
        ({"moved": 0.95 * MAX_SWAY}, True),
        ({"moved": 1.05 * MAX_SWAY}, False),  # still moves
        ({"speed": 0.95 * MAX_DESCENT}, True),
        ({"speed": 1.05 * MAX_DESCENT}, False),  # fell over
    ],
)
def test_each_bound_decides(changes, lies):
    assert bool(judge_lying(*record(**changes), "supine").lies) is lies


def test_the_descent_in_a_record_is_that_of_its_height(tiny: Robot):
    """Robots that lie on their backs for 2 s; one is dragged sideways, one sinks by as much."""
    neck = np.zeros((2, 200, 3))
    neck[0, :, 1] = neck[1, :, 2] = -0.01 * np.arange(200)  # 1 m/s
    qpos = np.tile([*np.zeros(3), *record("supine")[0][-1], 0.0, 0.0], (2, 200, 1))
    lying = measure_lying(make_record(tiny, (2, 200), PERIOD, neck=neck, qpos=qpos), "supine")
    assert lying.descent == pytest.approx([0.0, 1.0])
    assert lying.lies.tolist() == [True, False]


@pytest.mark.parametrize(("count", "lies"), [(100, False), (101, True)])
def test_a_record_of_no_more_than_a_second_tells_nothing(count: int, lies: bool):
    orientation, joint_pos, neck, period = (r[-count:] if np.ndim(r) else r for r in record())
    assert judge_lying(orientation, joint_pos, neck, period, "supine").lies == lies
    batch = [np.stack([row] * 3) for row in (orientation, joint_pos, neck)]
    assert judge_lying(*batch, period, "supine").lies.tolist() == [lies] * 3


def test_gravity_on_a_side_is_a_unit_vector_that_opposite_sides_reverse():
    supine, prone, left, right = map(np.array, (GRAVITY_B[side] for side in SIDES))
    assert [(supine + prone).any(), (left + right).any()] == [False, False]
    assert np.linalg.norm([supine, left], axis=1).tolist() == [1.0, 1.0]
