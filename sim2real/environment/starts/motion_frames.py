"""Initial states of training episodes: frames of the robot's stored motions."""

from __future__ import annotations

import mujoco
import numpy as np

from humanoid_getup.motions.motion import Motion
from humanoid_getup.motions.motion_database import MOTION_FOLDER
from robots import Robot
from robots.kinematics import place
from robots.quaternion import Array

# Every fourth frame of a motion, 32 ms apart on the OP3: between two, joints move 0.17 rad at
# most, so that more frames would hardly differ.
FRAMES_APART = 4


def list_motion_starts(robot: Robot, model: mujoco.MjModel) -> Array:
    """List frames of the robot's stored motions as MuJoCo positions, (M, nq)."""
    files = sorted((robot.folder / MOTION_FOLDER).glob("*.npz"))
    frames = [
        place(robot, model, motion.posture(frame))
        for motion in map(Motion.load, files)
        for frame in range(0, len(motion.time), FRAMES_APART)
    ]
    return np.array(frames).reshape(-1, model.nq)
