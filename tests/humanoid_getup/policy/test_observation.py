"""What a policy sees, and its mirror image."""

from dataclasses import replace

import numpy as np
import pytest

from humanoid_getup.policy.action import build_action_spec
from humanoid_getup.policy.observation import (
    Sensed,
    compute_torque_share,
    list_terms,
    observe,
)
from robots import load_robot

OP3 = load_robot("op3")
ACTION = build_action_spec(OP3, OP3.rising_joints, ("l_knee",))
SIZE = sum(term.size for term in list_terms(OP3, ACTION))


def sample_terms(*shape: int) -> tuple:
    """Sample what a policy senses, its targets, its last action and its torque share."""
    rng = np.random.default_rng(0)
    sensed = Sensed(
        gravity=rng.normal(size=(*shape, 3)),
        gyro=rng.normal(size=(*shape, 3)),
        joint_pos=rng.normal(size=(*shape, OP3.n)),
        joint_vel=rng.normal(size=(*shape, OP3.n)),
    )
    target, last = rng.normal(size=(*shape, OP3.n)), rng.normal(size=(*shape, ACTION.size))
    return sensed, target, last, rng.random((*shape, 1))


def test_one_robot_and_many_see_the_same():
    sensed, *others = sample_terms(5)
    many = observe(OP3, sensed, *others)
    assert many.shape == (5, SIZE)
    assert many.dtype == np.float32
    for i in range(5):
        one = Sensed(**{name: value[i] for name, value in vars(sensed).items()})
        assert np.array_equal(observe(OP3, one, *(values[i] for values in others)), many[i])


def test_a_torque_limit_is_observed_as_a_share_and_no_more_than_the_policy_asks_for():
    limits = np.array([2.05, 4.1, 9.0])
    assert compute_torque_share(OP3, ACTION, limits).tolist() == [[0.5], [1.0], [1.0]]
    assert compute_torque_share(OP3, ACTION, np.inf).tolist() == [1.0]
    gentle = replace(ACTION, pwm_limit=0.55)
    assert compute_torque_share(OP3, gentle, limits).tolist() == [[0.5], [0.55], [0.55]]


def test_every_term_is_where_the_list_says():
    n, k = OP3.n, ACTION.size
    sensed = Sensed(
        gravity=np.full(3, 1.0),
        gyro=np.full(3, 2.0),
        joint_pos=OP3.standing.joint_pos + 3.0,
        joint_vel=np.full(n, 4.0),
    )
    target = sensed.joint_pos + 5.0
    seen = observe(OP3, sensed, target, np.full(k, 6.0), np.full(1, 7.0))
    sizes = [term.size for term in list_terms(OP3, ACTION)]
    parts = np.split(seen, np.cumsum(sizes)[:-1])
    assert [len(part) for part in parts] == sizes
    for value, part in enumerate(parts, start=1):
        assert part == pytest.approx(np.full(len(part), value))
