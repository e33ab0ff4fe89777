"""Crouches balance on their soles, most of them bent forward."""

import numpy as np
import pytest

from robots import Robot, quaternion
from robots.body.crouches import draw_crouches
from robots.body.limbs import Limbs
from robots.body.statics import Statics

UP = np.array([0.0, 0.0, 1.0])


@pytest.fixture(scope="module")
def limbs(op3: Robot) -> Limbs:
    return Limbs(op3)


def find_up(posture) -> np.ndarray:
    """Return the vertical in the torso's frame: its x is negative as the chest looks down."""
    return quaternion.rotate(quaternion.inverse(posture.orientation), UP)


def test_most_crouches_bend_forward_and_all_balance(op3: Robot, limbs: Limbs):
    crouches, statics = draw_crouches(limbs, 24, np.random.default_rng(0)), Statics(op3)
    ahead = np.array([find_up(statics.make_posture(each))[0] for each in crouches])
    assert len(crouches) > 8
    assert ahead.min() < -0.6
    assert ahead.max() > 0.1
    assert np.mean(ahead < 0.0) > 0.6
    balance = [limbs.measure_balance(each) for each in crouches]
    assert all(each is not None and abs(each) < 0.05 for each in balance)
