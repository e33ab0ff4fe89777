"""Records of many robots are cut, arranged and joined without a change of what they say."""

import numpy as np
from records import make_record

from humanoid_getup.experiments.judging.record import join_records
from robots import Robot

PERIOD = 0.01


def test_a_robot_whose_physics_diverged_is_upright_in_no_piece(tiny: Robot):
    sound = make_record(tiny, (3, 4), PERIOD)
    broken = make_record(tiny, (3, 4), PERIOD, diverged=np.array([False, True, False]))
    whole = join_records([sound, broken, sound])
    assert whole.diverged.tolist() == [False, True, False]
    assert whole.upright.all(axis=1).tolist() == [True, False, True]
    assert whole.upright.any(axis=1).tolist() == [True, False, True]
    assert whole.stance.non_foot_contact.all(axis=1).tolist() == [False, True, False]
    assert whole.stance.non_foot_contact.any(axis=1).tolist() == [False, True, False]
