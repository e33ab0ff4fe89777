"""Motions of planned rises: a path without physics goes over into the stored motion."""

import numpy as np
import pytest

from humanoid_getup.filtering.reference import straight_path
from humanoid_getup.motions.motion_database import Connection, load_database
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.rise_motion import chain


def test_a_chained_motion_is_the_path_and_then_the_motions_own_targets(world: World):
    robot, joined = world.robot, load_database(world.robot).rising[0]
    frame = int(joined.entry_frames[-1])
    goal = joined.posture(frame)
    start = joined.posture(0)
    path = straight_path(start, goal, 2.0, robot.control_period)
    motion = chain(world, path, Connection(joined, frame, 0.0))
    count, rest = len(path.time), len(joined.time) - frame
    assert len(motion.time) == count + rest
    np.testing.assert_allclose(np.diff(motion.time), robot.control_period)
    np.testing.assert_array_equal(motion.joint_target[:count], path.joint_pos)
    np.testing.assert_array_equal(motion.joint_target[count:], joined.joint_target[frame:])
    np.testing.assert_array_equal(motion.joint_pos[count:], joined.joint_pos[frame:])
    # The motion goes on where the path ends, over the ground and in height.
    np.testing.assert_allclose(motion.position[count], path.position[-1])
    assert motion.name == f"path_to_{joined.name}"
    assert (motion.rises, motion.start_class) == (True, joined.start_class)
    assert motion.provenance["path_frames"] == pytest.approx(count)
