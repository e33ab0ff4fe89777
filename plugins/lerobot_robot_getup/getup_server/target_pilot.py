"""The pilot: moves a robot to the targets of LeRobot's actions until it has fallen."""

from __future__ import annotations

import math

import numpy as np

from drivers import Command, State
from getup_server.mailbox import Mailbox
from getup_server.messages import Setup
from getup_server.shared_guard import SharedGuard, TorsoSense
from humanoid_getup.playback.monitors import DOWN, Persistence, vector_angle
from robots.quaternion import Array

FALLEN_TIME = 0.2  # s beyond the tilt: a push that the robot survives is shorter
OBEYING = "obeying"
HANG_TIME = 0.1  # s without a message, after which LeRobot's process may hang: joints are held
AWAY_TIME = 1.0  # s, after which the next action is approached slowly
AWAY = f"held: no message from LeRobot for {AWAY_TIME:g} s"


class FallWatch:
    """Watches whether the torso leans so far, and for so long, that the robot has fallen."""

    def __init__(self, sense: TorsoSense, tilt: float) -> None:
        """Watch for a tilt [rad]; infinity for a robot that does not rise."""
        self._sense, self._tilt = sense, tilt
        self._leaning = Persistence(1, 0.0)

    def reset(self, state: State) -> None:
        """Begin at a measurement."""
        self._leaning = Persistence(1, state.time)

    def leans(self, state: State) -> bool:
        """Return whether the torso leans beyond the tilt now; a robot without an IMU never does."""
        gravity_b = self._sense.find_gravity(state)
        return len(gravity_b) > 0 and vector_angle(gravity_b, DOWN) > self._tilt

    def has_fallen(self, state: State) -> bool:
        """Return whether it has leant for long enough."""
        return self._leaning.update(self.leans(state), state.time).item() > FALLEN_TIME


class TargetPilot:
    """Moves joints to the newest targets; without any, they are held.

    After the start, a rise and a long silence, joints go to the first targets at the speed of the
    approach. While LeRobot's process is silent, they stay where they are.
    """

    def __init__(
        self, guard: SharedGuard, mailbox: Mailbox, setup: Setup, watch: FallWatch, limit: float
    ) -> None:
        """Prepare to move the robot of a guard, with at most ``limit`` N·m."""
        self._guard, self._mailbox, self._watch = guard, mailbox, watch
        self._robot, self._torque_limit = guard.robot, limit
        self._step = setup.max_speed * guard.period
        self._approach_step = min(setup.approach_speed * guard.period, self._step)
        self._number = {name: i for i, name in enumerate(self._robot.joint_names)}
        self.fallen = False

    @property
    def done(self) -> bool:
        """Return whether the robot has fallen, or is to end."""
        return self.fallen or self._mailbox.is_stopping()

    def reset(self, state: State) -> None:
        """Hold the targets that the servos have, and begin to obey."""
        self._target = self._guard.held.copy()
        self._goal = self._target.copy()
        self._has_arrived = self.fallen = self._is_away = False
        self._watch.reset(state)
        self._mailbox.begin(OBEYING, rising=False)

    def step(self, state: State) -> Command:
        """Move towards the newest targets."""
        self.fallen = self._watch.has_fallen(state)
        action = self._mailbox.take()
        for joint, angle in action.items():
            self._goal[self._number[joint]] = angle
        if self._is_away and action:
            self._is_away = self._has_arrived = False
            self._mailbox.begin(OBEYING, rising=False)
        silence = self._mailbox.silence
        if silence > AWAY_TIME and not self._is_away:
            self._is_away = True
            self._mailbox.begin(AWAY, rising=False)
        if self._is_away or silence > HANG_TIME:
            self._target = self._guard.held.copy()
        else:
            self._target = self._approach(self._goal)
        return Command.position(self._robot, self._target, self._torque_limit)

    def _approach(self, goal: Array) -> Array:
        """Return the next targets on the way to a goal [rad], (n,)."""
        step = self._step if self._has_arrived else self._approach_step
        moved = goal - self._target
        self._has_arrived |= bool(np.all(np.abs(moved) <= step))
        return goal.copy() if math.isinf(step) else self._target + np.clip(moved, -step, step)
