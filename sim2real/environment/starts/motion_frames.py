"""Initial states of training episodes: frames of the robot's stored motions."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from humanoid_getup.motions.motion import Motion
from humanoid_getup.motions.motion_database import MOTION_FOLDER
from robots import Robot
from robots.kinematics import mirror_positions, place
from robots.quaternion import Array

# Every fourth frame of a motion, 32 ms apart on the OP3: between two, joints move 0.17 rad at
# most, so that more frames would hardly differ.
FRAMES_APART = 4
LEVELS = 6  # of the ways that are left to the stand


def list_motion_starts(robot: Robot, model: mujoco.MjModel) -> Array:
    """List frames of the robot's stored motions as MuJoCo positions, (M, nq)."""
    files = sorted((robot.folder / MOTION_FOLDER).glob("*.npz"))
    frames = [
        place(robot, model, motion.posture(frame))
        for motion in map(Motion.load, files)
        for frame in range(0, len(motion.time), FRAMES_APART)
    ]
    return np.array(frames).reshape(-1, model.nq)


def list_rises(robot: Robot) -> list[Motion]:
    """List the robot's stored motions that rise.

    Raises:
        ValueError: if there is none.
    """
    folder = robot.folder / MOTION_FOLDER
    rises = [motion for file in sorted(folder.glob("*.npz")) if (motion := Motion.load(file)).rises]
    if not rises:
        raise ValueError(
            f"robot '{robot.name}' has no rising motion in {folder} to start along, expected one "
            f"(getup motions discover --robot {robot.name})"
        )
    return rises


def list_backward_starts(robot: Robot, model: mujoco.MjModel) -> tuple[Array, NDArray[np.int_]]:
    """List frames of the robot's rises as MuJoCo positions (M, nq), and their levels (M,).

    Level 0 are frames of the last sixth of a rise, up to `LEVELS` - 1 for those of the first. Each
    comes with its mirror image.

    Raises:
        ValueError: if there is no motion that rises.
    """
    frames, levels = list[Array](), list[int]()
    for motion in list_rises(robot):
        left = 1.0 - (motion.time - motion.time[0]) / (motion.time[-1] - motion.time[0])
        for frame in range(0, len(motion.time), FRAMES_APART):
            frames.append(place(robot, model, motion.posture(frame)))
            levels.append(min(int(left[frame] * LEVELS), LEVELS - 1))
    states = np.array(frames)
    both = np.concatenate([states, mirror_positions(robot, model, states)])
    return both, np.tile(levels, 2)
