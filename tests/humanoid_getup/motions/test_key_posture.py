"""Key postures: named by a file, or by a motion and a time."""

import numpy as np
import pytest
from mirror_images import mirror_posture

from humanoid_getup.motions.key_posture import load_key
from humanoid_getup.motions.motion_database import find_motion
from robots import Robot


@pytest.mark.parametrize(("time", "frame"), [(0.0, 0), (0.099, 12), (0.103, 13)])
def test_a_time_names_the_nearest_frame_of_a_motion(op3: Robot, time: float, frame: int):
    motion = find_motion(op3, "squat_to_stand")
    key = load_key(f"motions:squat_to_stand@{time}", op3)
    assert motion.time[frame] == pytest.approx(time, abs=0.004)
    np.testing.assert_array_equal(key.posture.joint_pos, motion.joint_pos[frame])


def test_a_mirrored_motion_has_key_postures_too(op3: Robot):
    left, right = (
        load_key(f"motions:lateral_side_sit{side}@1", op3).posture for side in ("", "_mirrored")
    )
    np.testing.assert_array_equal(mirror_posture(op3, left).joint_pos, right.joint_pos)
