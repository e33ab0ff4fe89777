"""Squats: deeper and deeper, in balance on flat soles."""

import numpy as np
import pytest

from robots import Robot
from robots.body.limb import LEGS
from robots.body.limbs import Limbs
from robots.body.squats import Squat, list_squats
from robots.body.statics import Statics


@pytest.fixture(scope="module")
def limbs(op3: Robot) -> Limbs:
    return Limbs(op3)


@pytest.fixture(scope="module")
def squats(limbs: Limbs, op3: Robot) -> list[Squat]:
    return list_squats(limbs, Statics(op3))


def test_squats_go_from_high_to_deep(squats: list[Squat]):
    heights = [squat.neck_share for squat in squats]
    assert len(heights) >= 8
    assert heights == sorted(heights, reverse=True)
    assert heights[-1] < 0.75


@pytest.mark.parametrize("depth", [0, 4, -1])
def test_the_mass_is_over_soles_that_are_parallel(squats: list[Squat], limbs: Limbs, depth: int):
    ahead = limbs.measure_balance(squats[depth].joint_pos)
    assert ahead is not None
    assert abs(ahead) < 0.05
    left, right = (limbs.leg(name) for name in LEGS)
    assert left.sole_axes[:, 2] @ right.sole_axes[:, 2] > 0.999
    assert abs(left.sole_position[0] - right.sole_position[0]) < 0.01


def test_arms_and_head_stay_in_the_stance(squats: list[Squat], limbs: Limbs, op3: Robot):
    legs = {k for name in LEGS for k in limbs.all[name].joints}
    others = [k for k in range(op3.n) if k not in legs]
    found = np.array([squat.joint_pos[others] for squat in squats])
    np.testing.assert_array_equal(found, np.tile(op3.standing.joint_pos[others], (len(squats), 1)))
