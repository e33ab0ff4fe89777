"""Stored motions, played by the script."""

from dataclasses import replace

import pytest
from play_motions import MotionPiece, find_lowest_limit, measure_motion

from humanoid_getup.experiments.falls import settle_posture
from humanoid_getup.experiments.judging.summary import wilson_interval
from humanoid_getup.motions.motion_database import load_database


@pytest.fixture
def one_motion(op3):
    return next(m for m in load_database(op3).motions if m.name == "prone_push_up_gentle")


def test_a_motion_is_played_and_disturbed(op3, world, one_motion):
    case = measure_motion(world, MotionPiece(motion=one_motion, number=0, seed=0, each=2))
    assert case.succeeded
    assert case.disturbed_n == 2
    assert case.disturbed_succeeded == 2  # a gentle motion bears what is drawn from this seed
    assert case.disturbed_interval_95 == wilson_interval(2, 2)
    assert case.peak_torque_nm <= op3.max_torque.max()
    assert case.lowest_torque_limit_nm <= 2.0
    still = one_motion.joint_target[:1].repeat(len(one_motion.time), axis=0)
    start = settle_posture(world, one_motion.posture(0))
    assert find_lowest_limit(world, replace(one_motion, joint_target=still), start) is None
