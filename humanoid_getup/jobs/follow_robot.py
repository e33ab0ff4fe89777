"""Follows a robot that another program moves: its posture, by its own sensors alone."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from drivers import State
from drivers.live_feed.follower import LiveFollower
from drivers.live_feed.messages import LiveSample
from humanoid_getup.jobs.errors import BadInputError
from humanoid_getup.playback.estimation import estimate_posture
from humanoid_getup.simulation.world import World
from robots import Posture, Robot


def check_robot(follower: LiveFollower, path: Path, robot: Robot) -> None:
    """Check that a feed is of a robot.

    Raises:
        BadInputError: if it is another one's.
    """
    hello = follower.hello
    if (hello.robot, hello.joint_names) != (robot.name, tuple(robot.joint_names)):
        raise BadInputError(
            f"feed {path.name} is of robot '{hello.robot}' with {len(hello.joint_names)} joints, "
            f"expected '{robot.name}' with {robot.n}: see --robot"
        )


def estimate_sample(world: World, sample: LiveSample) -> Posture:
    """Estimate the posture of a sample: upright without an IMU, and lying where it begins."""
    n = world.robot.n
    has_imu = len(sample.orientation) == 4
    if not has_imu:
        return Posture(
            position=world.robot.standing.position,
            orientation=np.array([1.0, 0.0, 0.0, 0.0]),
            joint_pos=np.array(sample.joint_pos),
        )
    state = State(
        time=sample.time,
        joint_pos=np.array(sample.joint_pos),
        joint_vel=np.zeros(n),
        joint_current=np.array(sample.joint_current),
        gyro=np.array(sample.gyro),
        orientation=np.array(sample.orientation),
        temperature=np.array(sample.temperature),
        voltage=sample.voltage,
    )
    return estimate_posture(world, state)
