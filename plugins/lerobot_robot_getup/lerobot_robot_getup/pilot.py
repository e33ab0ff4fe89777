"""The pilot: moves a robot to the targets of LeRobot's actions until it has fallen."""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Callable

import numpy as np

from drivers import Backend, Command, GuardLimits, SafetyGuard, State
from humanoid_getup.playback.monitors import DOWN, Persistence, vector_angle
from lerobot_robot_getup.config_getup_robot import GetupRobotConfig
from robots.kinematics import GravitySense
from robots.quaternion import Array

logger = logging.getLogger(__name__)

FALLEN_TIME = 0.2  # s beyond the tilt: a push that the robot survives is shorter
HANG_TIME = 0.1  # s without a call, after which LeRobot's program may hang: joints are held
AWAY_TIME = 1.0  # s, after which the next action is approached slowly


class WatchedGuard(SafetyGuard):
    """A safety guard that keeps what it measured and sent, and ends the work on request."""

    measured: State
    answer: Array
    """Targets with which the last action was sent [rad], (n,)."""

    def __init__(self, backend: Backend, limits: GuardLimits, check: Callable[[], None]) -> None:
        """Guard a backend; ``check`` raises an error if the work is to end."""
        super().__init__(backend, limits)
        self._check, self._last = check, Command.limp(self.robot.n)
        self.action: Array | None = None
        """Target angles from LeRobot until they are sent [rad], (n,), NaN to keep one."""
        self.taken: Array | None = None
        """Action that the next command obeys."""

    @property
    def targets(self) -> Array:
        """Return the last targets; the measured angles of joints without torque [rad], (n,)."""
        last = self._last
        return np.where(last.torque_limit > 0.0, last.joint_pos, self.measured.joint_pos)

    def read(self) -> State:
        """Measure the robot; if it is to end, an error is raised, and torque goes off with it."""
        self._check()
        self.measured = super().read()
        return self.measured

    def write(self, command: Command) -> Command:
        """Send a command within the limits; return what was sent."""
        self._last = super().write(command)
        if self.action is self.taken:
            self.answer, self.action = self.targets, None
        return self._last


class Pilot:
    """Moves joints to the newest targets until the robot has fallen.

    After the start, a rise and a long silence, joints go to the first targets at the speed of the
    approach. While LeRobot's program is silent, they stay where they are.
    """

    def __init__(
        self, guard: WatchedGuard, sense: GravitySense | None, config: GetupRobotConfig
    ) -> None:
        """Prepare to move the robot of a guard; without a sense of gravity, it never falls."""
        self._guard, self._sense = guard, sense
        self._torque_limit = float(guard.limits.torque_limit.max())
        fastest = math.inf if config.max_speed is None else math.radians(config.max_speed)
        self._step = fastest * guard.period
        self._approach_step = min(math.radians(config.approach_speed) * guard.period, self._step)
        self._fallen_tilt = math.radians(config.fallen_tilt) if config.rises else math.inf
        self.heard_at = time.monotonic()
        """When LeRobot called last."""
        self.done = False
        """Whether the robot has fallen."""

    def leans(self, state: State) -> bool:
        """Return whether the torso leans beyond the tilt of a fallen robot now."""
        if self._sense is None:
            return False
        return bool(vector_angle(self._sense(state.orientation), DOWN) > self._fallen_tilt)

    def reset(self, state: State) -> None:
        """Hold the targets that the servos have, and begin to obey."""
        self._target = self._goal = self._guard.targets
        self._leaning = Persistence(1, state.time)
        self._has_arrived = self._is_away = self.done = False

    def step(self, state: State) -> Command:
        """Move towards the newest targets."""
        self.done = self._leaning.update(self.leans(state), state.time).item() > FALLEN_TIME
        silence = time.monotonic() - self.heard_at
        if (action := self._guard.action) is not None:
            self._guard.taken = action
            self._goal = np.where(np.isnan(action), self._goal, action)
            self._has_arrived &= not self._is_away
            self._is_away = False
        elif silence > AWAY_TIME and not self._is_away:
            self._is_away = True
            logger.warning("no call from LeRobot for %g s: joints are held", AWAY_TIME)
        if silence > HANG_TIME or self._is_away:
            self._target = self._guard.targets
        else:
            self._target = self._approach()
        return Command.position(self._guard.robot, self._target, self._torque_limit)

    def _approach(self) -> Array:
        """Return the next targets on the way to the goal [rad], (n,)."""
        step = self._step if self._has_arrived else self._approach_step
        moved = self._goal - self._target
        self._has_arrived |= bool(np.all(np.abs(moved) <= step))
        return self._goal if math.isinf(step) else self._target + np.clip(moved, -step, step)
