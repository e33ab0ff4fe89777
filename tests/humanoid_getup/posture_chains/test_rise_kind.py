"""Rises are named by the postures that they pass."""

import numpy as np
import pytest

from humanoid_getup.motions.motion import Motion
from humanoid_getup.motions.motion_database import find_motion
from humanoid_getup.posture_chains.rise_kind import KindNamer
from humanoid_getup.simulation.world import World
from robots.kinematics import place


def name(world: World, motion: Motion) -> str:
    assert motion.stand_time is not None
    rows = np.flatnonzero(motion.time <= motion.stand_time)
    qpos = np.array([place(world.robot, world.model, motion.posture(int(row))) for row in rows])
    return KindNamer(world).name(qpos, motion.start_class)


@pytest.mark.parametrize(
    ("motion", "passed"),
    [
        ("prone_push_up_gentle", "all fours, squat"),
        ("supine_roll_over", "bridge, right, prone, all fours, squat"),
    ],
)
def test_stored_motions_pass_what_they_are_named_after(world: World, motion: str, passed: str):
    assert name(world, find_motion(world.robot, motion)) == passed
