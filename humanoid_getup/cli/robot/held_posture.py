"""Postures in which a person holds a robot: all angles 0, its stance, or a posture file."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from humanoid_getup.jobs.errors import BadInputError, refusing
from robots import Robot, load_posture
from robots.quaternion import Array

ZERO, STANDING = "zero", "standing"


def find_held_angles(robot: Robot, at: str) -> Array:
    """Return the joint angles of a held posture [rad], (n,).

    Raises:
        BadInputError: if it is neither known nor a posture file of the robot.
    """
    if at == ZERO:
        return np.zeros(robot.n)
    if at == STANDING:
        return robot.standing.joint_pos
    if not Path(at).exists():
        raise BadInputError(f"unknown posture '{at}': expected zero, standing, or a file")
    with refusing():
        return load_posture(Path(at), robot).joint_pos
