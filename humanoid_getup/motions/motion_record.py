"""Records what a robot was sent and where it was as a motion."""

from __future__ import annotations

from typing import Any

from humanoid_getup.motions.motion import Motion
from humanoid_getup.simulation.world import World
from robots import Posture
from robots.kinematics import read_posture
from robots.quaternion import Array


def record_motion(
    world: World, start: Posture, target: Array, qpos: Array, **fields: Any
) -> Motion:
    """Make a motion from sent targets and recorded postures.

    Args:
        world: Robot and scene.
        start: Where it was at the start.
        target: Targets at each control period [rad], (T, n).
        qpos: MuJoCo positions at the end of each control period, (T or more, nq).
        fields: All else of the motion.
    """
    robot, went = world.robot, qpos[: len(target) - 1]
    return Motion.through(
        [start, *(read_posture(robot, world.model, q) for q in went)],
        robot.control_period,
        robot=robot.name,
        joint_target=target,
        **fields,
    )
