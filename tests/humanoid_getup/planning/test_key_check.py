"""Key postures that no robot can be in are refused, each by its name."""

from dataclasses import replace

import numpy as np
import pytest

from humanoid_getup.motions.motion_database import KeyPosture, name_keys
from humanoid_getup.planning.collision import check_keys
from robots import Posture, Robot


def bend(robot: Robot, joint: str, angle: float) -> Posture:
    angles = robot.standing.joint_pos.copy()
    angles[robot.joint_names.index(joint)] = angle
    return replace(robot.standing, joint_pos=angles)


def test_a_posture_may_be_anywhere_even_in_the_ground(op3: Robot):
    sunk = replace(op3.standing, position=np.array([5.0, 0.0, -3.0]))
    check_keys(op3, name_keys([sunk, op3.standing]))


def test_every_key_that_is_wrong_is_named(op3: Robot):
    short = replace(op3.standing, joint_pos=op3.standing.joint_pos[:3])
    keys = [
        KeyPosture(name="bent", posture=bend(op3, "l_knee", 3.5)),
        KeyPosture(name="fine", posture=op3.standing),
        KeyPosture(name="crossed", posture=bend(op3, "l_hip_roll", 0.5)),
        KeyPosture(name="short", posture=short),
    ]
    with pytest.raises(ValueError) as refusal:
        check_keys(op3, keys)
    bent, crossed, shape = str(refusal.value).split("; posture ")
    assert bent.startswith("posture bent: joint 'l_knee' is +3.500 rad, expected [")
    assert crossed.startswith("crossed: ") and "mm inside" in crossed
    assert shape == f"short: joint_pos is (3,), expected ({op3.n},)"
