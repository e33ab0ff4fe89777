"""Ways through key postures: stretches of stored motions that lead there, and what is planned."""

from dataclasses import replace

import numpy as np
import pytest

from humanoid_getup.motions.motion_database import MotionDatabase, load_database
from humanoid_getup.strategies.key_postures.key_routes import find_stretches
from robots import Robot


@pytest.fixture(scope="module")
def database(op3: Robot) -> MotionDatabase:
    return load_database(op3)


def test_the_stretch_that_leads_to_a_frame_of_a_motion_is_from_that_motion(database):
    motion = next(m for m in database.rising if m.name == "prone_push_up_gentle")
    frame = len(motion.time) // 2
    best = find_stretches(database, motion.posture(0), motion.posture(frame), 3)[0]
    assert (best.motion.name, best.first, best.last) == (motion.name, 0, frame)
    assert best.distance == pytest.approx(0.0, abs=1e-6)


def test_stretches_are_one_of_each_motion_the_nearest_first_and_begin_where_it_may_be_entered(
    database,
):
    start, key = database.rising[0].posture(0), database.rising[0].posture(60)
    found = find_stretches(database, start, key, 100)
    assert len({one.motion.name for one in found}) == len(found)
    assert np.all(np.diff([one.distance for one in found]) >= 0.0)
    assert all(one.first in one.motion.entry_frames and one.first < one.last for one in found)
    assert find_stretches(database, start, key, 2) == found[:2]


def test_a_motion_that_is_nearest_to_the_key_before_it_may_be_entered_leads_there_not(database):
    motion = database.rising[0]
    late = replace(motion, entry=np.arange(len(motion.time)) == len(motion.time) - 1)
    alone = MotionDatabase([late], database.metric)
    assert find_stretches(alone, motion.posture(0), motion.posture(1), 3) == []
