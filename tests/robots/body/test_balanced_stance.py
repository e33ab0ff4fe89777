"""Stances: balanced on flat soles at the height that is asked for, the arms hanging."""

import numpy as np
import pytest

from robots.body.balanced_stance import BalancedStance, StanceSolver
from robots.body.body_plan import BodyPlan


@pytest.fixture(scope="module")
def stance(small: BodyPlan) -> BalancedStance:
    return StanceSolver(small, np.zeros(len(small.joint_names))).solve(0.9)


def test_both_soles_are_flat_and_side_by_side(small: BodyPlan, stance: BalancedStance):
    assert stance.is_solved
    small.view.look(stance.joint_pos)
    data = small.view.data
    left, right = (data.site(name) for name in small.soles)
    for sole in (left, right):
        assert sole.xmat.reshape(3, 3)[2, 2] > np.cos(np.radians(1.0))
    assert left.xpos == pytest.approx(right.xpos * [1, -1, 1], abs=1e-9)


def test_the_mass_is_above_the_soles_and_the_legs_are_bent(small: BodyPlan, stance: BalancedStance):
    small.view.look(stance.joint_pos)
    leg = small.left_leg
    length = leg.measure_stretched()
    ahead = small.view.center_of_mass[0] - leg.sole_position[0]
    assert abs(ahead) < 0.03 * length
    assert leg.hip[2] - leg.sole_position[2] == pytest.approx(0.9 * length, abs=0.03 * length)
    assert leg.measure_knee_lead() > 0.0


def test_arms_hang_beside_the_body_and_further_out_if_asked(
    small: BodyPlan, stance: BalancedStance
):
    solver, arm = StanceSolver(small, stance.joint_pos), small.arms[0][0]

    def slope(angles: np.ndarray) -> float:
        small.view.look(angles)
        way = small.view.end(arm[-1]) - small.view.anchor(arm[0])
        return float(way[1] / -way[2])

    near, far = slope(stance.joint_pos), slope(solver.solve(0.9, 0.6).joint_pos)
    assert near == pytest.approx(0.1, abs=0.1)
    assert far == pytest.approx(0.6, abs=0.1)


def test_angles_are_mirrored_and_within_the_ranges(small: BodyPlan, stance: BalancedStance):
    mirror = small.mirror
    assert stance.joint_pos == pytest.approx(mirror.sign * stance.joint_pos[mirror.index])
    assert (stance.joint_pos >= small.lower).all()
    assert (stance.joint_pos <= small.upper).all()


def test_a_leg_cannot_be_longer_than_stretched(small: BodyPlan):
    solver = StanceSolver(small, np.zeros(len(small.joint_names)))
    assert not solver.solve(1.2).is_solved
