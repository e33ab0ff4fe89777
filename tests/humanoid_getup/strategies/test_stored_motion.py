"""Stored motions as strategies: one for every start, or the nearest."""

import numpy as np
import pytest
from nonempty import nonempty

from humanoid_getup.motions.motion_database import find_lying_down, load_database
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.stored_motion import NearestMotion, StoredMotion

RNG = np.random.default_rng(0)


def test_a_motion_that_does_not_rise_is_refused_by_its_end(world: World):
    down = find_lying_down(world.robot)
    with pytest.raises(ValueError, match=f"ends lying {down.end_class}, expected one that ends"):
        StoredMotion(world, down)


def test_a_motion_is_its_own_nearest_from_where_it_may_be_entered(world: World):
    database = load_database(world.robot)
    strategy = NearestMotion(world, database)
    for motion in nonempty(database.rising[:4]):
        plan = strategy.plan(motion.posture(int(motion.entry_frames[0])), RNG)
        assert plan.connection is not None and plan.connection.distance < 1e-6
        assert plan.motion is plan.connection.motion
