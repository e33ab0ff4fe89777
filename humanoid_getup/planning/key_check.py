"""Checks that key postures are possible for a robot, independent of their place."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from humanoid_getup.motions.key_posture import KeyPosture
from humanoid_getup.planning.collision import CollisionChecker
from humanoid_getup.scenes.scene import FLAT_SCENE
from robots import Robot

RAISED = np.array([0.0, 0.0, 10.0])  # m, clear of the ground


def check_keys(robot: Robot, keys: Sequence[KeyPosture]) -> None:
    """Check that key postures are within the joint limits and free of self-collision.

    Raises:
        ValueError: naming what is wrong with each posture that is not.
    """
    if not keys:
        return
    checker, problems = CollisionChecker(robot, FLAT_SCENE), list[str]()
    for key in keys:
        checker.reset()
        if key.posture.joint_pos.shape != (robot.n,):
            shape = key.posture.joint_pos.shape
            problems.append(f"posture {key.name}: joint_pos is {shape}, expected ({robot.n},)")
        elif found := checker.allow(replace(key.posture, position=RAISED)):
            problems.append(f"posture {key.name}: {found}")
    if problems:
        raise ValueError("; ".join(problems))
