"""The player: a controller that sends a motion's targets on time."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from drivers.control_loop import Controller
from drivers.state import Command, State
from humanoid_getup.motions.motion import Motion
from humanoid_getup.playback.balance import Balance
from robots import Robot
from robots.quaternion import Array


class TimedController(Controller, Protocol):
    """A controller that ends by itself."""

    @property
    def longest(self) -> float:
        """Return its longest duration [s], without the approach to its start."""
        ...


APPROACH_SPEED = 1.5  # rad/s, to the first target


class MotionPlayer:
    """Plays a motion's servo targets, then holds the last for a while.

    A robot whose joints are elsewhere first approaches the motion's first targets, all joints
    together and no faster than ``APPROACH_SPEED``.
    """

    def __init__(
        self,
        robot: Robot,
        motion: Motion,
        *,
        hold: float,
        torque_limit: float | None = None,
        held: Array | None = None,
        balance: Balance | None = None,
    ) -> None:
        """Prepare to play a motion, and to ``hold`` its end for a while [s].

        ``held`` are the targets that the servos follow already [rad], (n,); ``None`` if torque is
        off, and begins where the joints are. ``balance`` corrects the targets; without it they
        are sent as they are.
        """
        self._robot, self._motion, self._torque_limit = robot, motion, torque_limit
        self.longest = motion.duration + hold
        """Time that motion and hold take [s]."""
        self.approach_time = 0.0
        """Time that the approach to the first targets takes [s]."""
        self._begin = self._clock = 0.0
        self._held, self._balance = held, balance
        self._from = motion.joint_target[0]

    @property
    def done(self) -> bool:
        """Return whether the motion and the hold are over."""
        return self._is_over(self.longest)

    def reset(self, state: State) -> None:
        """Begin at the held targets, or at the measured joint angles."""
        self._begin = self._clock = state.time
        self._from = state.joint_pos if self._held is None else self._held
        self.approach_time = find_approach_time(self._robot, self._motion, self._from)
        if self._balance is not None:
            self._balance.reset(self._from)

    def _is_over(self, duration: float) -> bool:
        """Return whether a time [s] has passed since the end of the approach."""
        return self._clock - self._begin >= self.approach_time + duration - 1e-9

    def step(self, state: State) -> Command:
        """Send the targets that are due at the measurement."""
        self._clock = state.time
        time = self._clock - self._begin - self.approach_time
        target = self._target(time)
        if self._balance is not None:
            target = self._balance.correct(state, time, target)
        return Command.position(self._robot, target, self._torque_limit)

    def _target(self, time: float) -> Array:
        first = self._motion.joint_target[0]
        if time < 0.0:
            return first + (time / self.approach_time) * (first - self._from)
        return self._motion.sample(self._motion.time[0] + time)


def find_approach_time(robot: Robot, motion: Motion, joint_pos: Array) -> float:
    """Compute the time of the approach to a motion's first targets [s] from angles [rad], (n,)."""
    distance = np.abs(motion.joint_target[0] - joint_pos)
    reach = robot.max_velocity * robot.control_period  # in one cycle
    return 0.0 if np.all(distance <= reach) else float(distance.max()) / APPROACH_SPEED
