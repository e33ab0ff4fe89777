"""A strategy that plays one stored motion."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from humanoid_getup.motions.motion import Motion
from humanoid_getup.motions.motion_database import find_motion
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.plan import MotionPlan, RiseStatus
from robots import FULL_TORQUE, Posture, TorqueLimit
from robots.torque_limit import check_torque_limit


class StoredMotion:
    """Plays one motion as it is, for every start; the preflight may refuse it."""

    def __init__(
        self,
        world: World,
        motion: Motion | str | Path,
        *,
        torque_limit: TorqueLimit = FULL_TORQUE,
    ) -> None:
        """Load a motion, or take a loaded one.

        Args:
            motion: Name of one of the robot's motions, an .npz file, or a motion.

        Raises:
            ValueError: if the motion is unknown, another robot's, or no rise.
        """
        self.world, self.torque_limit = world, check_torque_limit(torque_limit, world.robot)
        is_loaded = isinstance(motion, Motion)
        self.motion = motion if is_loaded else find_motion(world.robot, str(motion))
        if not self.motion.rises:
            raise ValueError(
                f"motion '{self.motion.name}' ends lying {self.motion.end_class}, expected one "
                "that ends standing"
            )

    def plan(self, _start: Posture, _rng: np.random.Generator) -> MotionPlan:
        """Plan to play the motion."""
        return MotionPlan(status=RiseStatus.STORED, motion=self.motion)
