"""Shaping of learned rises: smooth, no faster than the servos, and ending in the stance."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from humanoid_getup.motions.keyframes import SPEED_SHARE
from robots import Robot
from sim2real.motion_discovery.policy_rise import BALANCING, SMOOTHINGS, PolicyRise, shape


def make_rise(robot: Robot, seed: int, step: float, stand_time: float = 1.0) -> PolicyRise:
    """Make targets that walk at random by steps [rad] at each control period."""
    walk = np.random.default_rng(seed).uniform(-step, step, (400, robot.n)).cumsum(axis=0)
    return PolicyRise(
        start_class="supine", start=np.zeros(robot.n + 7), target=walk, stand_time=stand_time
    )


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 1000), step=st.floats(0.0, 0.5), smoothing=st.sampled_from(SMOOTHINGS))
def test_shaped_targets_are_never_faster_than_the_servos_and_end_standing(
    op3: Robot, seed: int, step: float, smoothing: float
):
    rise = make_rise(op3, seed, step)
    shaped = shape(op3, rise, smoothing)
    speed = np.abs(np.diff(shaped, axis=0)) / op3.control_period
    assert np.all(speed <= SPEED_SHARE * op3.max_velocity * 1.001)
    assert shaped[0] == pytest.approx(rise.target[0])
    assert shaped[-1] == pytest.approx(op3.standing.joint_pos)


def test_slow_targets_stay_as_they_were_until_the_policy_has_balanced(op3: Robot):
    rise = make_rise(op3, 0, 0.02)
    count = round((rise.stand_time + BALANCING) / op3.control_period)
    assert np.array_equal(shape(op3, rise, 0.0)[:count], rise.target[:count])


def test_smoothing_takes_away_what_goes_back_and_forth(op3: Robot):
    rise = make_rise(op3, 0, 0.02)
    rough, smooth = (np.diff(shape(op3, rise, s), n=2, axis=0)[50:200] for s in (0.0, 0.05))
    assert np.square(smooth).mean() < 0.01 * np.square(rough).mean()
