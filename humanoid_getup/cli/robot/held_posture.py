"""Postures in which a person holds a robot: all angles 0, its stance, or a posture file."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from humanoid_getup.commands.errors import BadInputError, refusing
from robots import Posture, Robot, load_posture

ZERO, STANDING = "zero", "standing"


def find_held_posture(robot: Robot, at: str) -> Posture:
    """Return a held posture; at zero, where its orientation is not known, it is upright.

    Raises:
        BadInputError: if it is neither known nor a posture file of the robot.
    """
    if at == ZERO:
        return replace(robot.standing, joint_pos=np.zeros(robot.n))
    if at == STANDING:
        return robot.standing
    if not Path(at).exists():
        raise BadInputError(f"unknown posture '{at}': expected zero, standing, or a file")
    with refusing():
        return load_posture(Path(at), robot)
