"""The stand holder: a controller that keeps a robot in its stand until it is released."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from humanoid_getup.motions.motion import STANDING, Motion
from humanoid_getup.playback.balance import Balance
from humanoid_getup.playback.motion_player import MotionPlayer
from robots import Robot
from robots.quaternion import Array


class StandHolder(MotionPlayer):
    """Sends the standing posture for a time, and then until it is released."""

    def __init__(
        self,
        robot: Robot,
        motion: Motion,
        *,
        least: float,
        is_released: Callable[[], bool],
        torque_limit: float | None = None,
        held: Array | None = None,
        balance: Balance | None = None,
    ) -> None:
        """Prepare to hold for at least a time [s].

        ``motion`` is that of `make_stand`; ``is_released`` is called every cycle; the others are
        those of the player.
        """
        super().__init__(
            robot, motion, hold=least, torque_limit=torque_limit, held=held, balance=balance
        )
        self._is_released = is_released
        self._least, self.longest = self.longest, math.inf

    @property
    def done(self) -> bool:
        """Return whether the time is over and the robot was released."""
        is_released = self._is_released()  # called every cycle
        return is_released and self._is_over(self._least)


def make_stand(robot: Robot) -> Motion:
    """Make the motion of one frame that is a robot's standing posture."""
    return make_still(robot, robot.standing.joint_pos)


def make_still(robot: Robot, target: Array) -> Motion:
    """Make the motion of one frame that sends targets [rad], (n,), expected to stand."""
    return Motion.through(
        [robot.standing],
        robot.control_period,
        name=STANDING,
        robot=robot.name,
        start_class=STANDING,
        strategy="standing still",
        joint_target=target[np.newaxis],
    )
