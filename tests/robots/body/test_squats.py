"""Squats: deeper and deeper, in balance on flat soles."""

import numpy as np
import pytest
from nonempty import nonempty

from robots import Robot
from robots.body.limb import LEGS
from robots.body.limbs import Limbs
from robots.body.squats import Squat, find_touching, list_squats
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


def test_the_mass_is_over_soles_that_are_parallel(squats: list[Squat], limbs: Limbs):
    left, right = (limbs.leg(name) for name in LEGS)
    for squat in nonempty(squats):
        ahead = limbs.measure_balance(squat.joint_pos)
        assert ahead is not None and abs(ahead) < 0.05, squat.neck_share
        assert left.sole_axes[:, 2] @ right.sole_axes[:, 2] > 0.999
        assert abs(left.sole_position[0] - right.sole_position[0]) < 0.01


def test_shapes_that_stop_a_squat_are_named(
    squats: list[Squat], limbs: Limbs, op3: Robot, monkeypatch: pytest.MonkeyPatch
):
    statics, pair = Statics(op3), ("l_ank_pitch_link", "l_hip_pitch_link")
    ids = tuple(sorted(limbs.model.body(name).id for name in pair))

    def touch(_: Limbs, joint_pos: np.ndarray) -> set[tuple[int, ...]]:
        return {ids} if statics.measure_neck(joint_pos) < 0.8 else set()

    monkeypatch.setattr("robots.body.squats.find_overlaps_but_arms", touch)
    higher = list_squats(limbs, statics)
    assert 0.8 <= higher[-1].neck_share < squats[0].neck_share
    assert [{*names} for names in find_touching(limbs, statics, higher)] == [{*pair}]
