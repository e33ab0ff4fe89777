"""Moves one servo of several by keys, a step at a press."""

from __future__ import annotations

import threading

import numpy as np

from drivers.state import Command, State
from robots import Robot
from robots.quaternion import Array


class JogController:
    """Holds one joint at a target that other threads move; all others are limp.

    The target moves towards what was last requested at a limited speed. A joint that is released,
    or left for another one, is limp.
    """

    def __init__(self, robot: Robot, *, speed: float, torque_limit: Array) -> None:
        """Prepare: no joint has torque until the first step is requested.

        Args:
            robot: Robot or bench that moves.
            speed: Speed of the joint [rad/s].
            torque_limit: Torque limit of each servo [N·m], (n,).
        """
        self._robot, self._speed, self._torque = robot, speed, torque_limit
        self._lock = threading.Lock()
        self.joint = 0
        """Number of the chosen joint."""
        self._wanted: float | None = None
        self._target = 0.0
        self._state: State | None = None
        self._time = 0.0
        self.done = False
        """Whether it was ended."""

    @property
    def state(self) -> State | None:
        """Return the newest measurement; None before the first."""
        return self._state

    @property
    def wanted(self) -> float | None:
        """Return the requested angle of the chosen joint [rad]; None while it is limp."""
        return self._wanted

    def choose(self, joint: int) -> None:
        """Choose a joint by its number, counted round; the one before is released."""
        with self._lock:
            self.joint = joint % self._robot.n
            self._wanted = None

    def nudge(self, angle: float) -> None:
        """Request an angle further [rad], up to the joint's range."""
        with self._lock:
            if self._state is None:
                return
            if self._wanted is None:
                self._target = self._wanted = float(self._state.joint_pos[self.joint])
            lower, upper = self._robot.lower[self.joint], self._robot.upper[self.joint]
            self._wanted = float(np.clip(self._wanted + angle, lower, upper))

    def release(self) -> None:
        """Switch the joint's torque off."""
        with self._lock:
            self._wanted = None

    def end(self) -> None:
        """End after the next cycle."""
        self.done = True

    def reset(self, state: State) -> None:
        """Start from a measurement."""
        self._state, self._time = state, state.time

    def step(self, state: State) -> Command:
        """Move the target towards what was requested."""
        with self._lock:
            passed, self._time, self._state = state.time - self._time, state.time, state
            command = Command.limp(self._robot.n)
            if self._wanted is None:
                return command
            reach = self._speed * passed
            self._target += float(np.clip(self._wanted - self._target, -reach, reach))
            command.joint_pos[self.joint] = self._target
            command.torque_limit[self.joint] = self._torque[self.joint]
            return command
