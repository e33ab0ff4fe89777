"""Retargeting to another body: the same joint angles, on the ground as before."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from humanoid_getup.motions.motion import Motion
from humanoid_getup.simulation.clearance import Clearance
from humanoid_getup.simulation.world import World
from robots import ORIGINAL, Robot, reshape
from robots.kinematics import lowest_points, place, place_postures
from robots.quaternion import Array

BODY = "body"
"""Key of a motion's provenance for the body that it was made for; none for the original."""
MOST_OVERLAP = 0.006  # m by which an entry posture may reach into itself; a goal of the planner


class Retargeting:
    """Retargets motions of a robot's original body to its present body, on flat ground.

    The joint angles and targets stay, as in [Lin12], section 5.3; what they do to the new body is
    up to the dynamics filter. The root is raised or lowered until the lowest point is as high as
    it was. Entry postures in which the new body reaches deep into itself are left out, unless the
    motion has no others.
    """

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self._old, self._new = World(reshape(robot, ORIGINAL)), World(robot)
        self._clearance = Clearance(self._new)

    def retarget(self, motion: Motion) -> Motion:
        """Retarget a motion of the original body."""
        lifted = motion.position.copy()
        lifted[:, 2] += self._lowest(self._old, motion) - self._lowest(self._new, motion)
        free = motion.entry.copy()
        free[motion.entry_frames] = [self._is_free(motion, k) for k in motion.entry_frames]
        return replace(
            motion,
            position=lifted,
            entry=free if np.any(free) else motion.entry,
            provenance=motion.provenance | name_body(self._robot),
        )

    def _lowest(self, world: World, motion: Motion) -> Array:
        qpos = place_postures(
            world.robot, world.model, motion.position, motion.orientation, motion.joint_pos
        )
        return lowest_points(world.model, qpos)

    def _is_free(self, motion: Motion, frame: int) -> bool:
        qpos = place(self._robot, self._new.model, motion.posture(frame))
        return self._clearance.measure_self_overlap(qpos) <= MOST_OVERLAP


def adapt(motion: Motion, robot: Robot, retargeting: Retargeting | None = None) -> Motion:
    """Return a motion for the body that a robot has: its own, or retargeted from the original.

    Args:
        motion: Made for the robot's original body, or for the one that it has.
        retargeting: Of this robot, where many motions are adapted.
    """
    made_for, body = str(motion.provenance.get(BODY, "")), str(robot.body)
    if made_for == body:
        return motion
    if made_for:
        raise ValueError(
            f"motion '{motion.name}' was made for the body '{made_for}', expected "
            + (f"'{body}' or the original" if body else "the original")
        )
    return (retargeting or Retargeting(robot)).retarget(motion)


def name_body(robot: Robot) -> dict[str, str | float | int]:
    """Return the entry of a motion's provenance that names the robot's body, if it has another."""
    return {} if robot.body.is_original else {BODY: str(robot.body)}
