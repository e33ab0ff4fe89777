"""A backend that measures given values and records its commands."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from drivers import Backend, Command, State
from robots import Robot


def still_state(robot: Robot, **changes) -> State:
    """A sound measurement of a robot at rest at angle 0."""
    n = robot.n
    state = State(
        time=0.0,
        joint_pos=np.zeros(n),
        joint_vel=np.zeros(n),
        joint_current=np.zeros(n),
        gyro=np.zeros(3),
        orientation=np.array([1.0, 0.0, 0.0, 0.0]),
        temperature=np.full(n, 25.0),
        voltage=12.0,
    )
    return replace(state, **changes)


class RecordingBackend(Backend):
    """Its clock moves with each write; its joints never move."""

    period = 0.008
    limit_by = "current"

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        self.state = still_state(robot)
        self.received: list[Command] = []
        self.clock_runs = True
        self.connected = False

    def connect(self) -> None:
        self.connected = True

    def close(self) -> None:
        self.connected = False

    def read(self) -> State:
        return self.state

    def write(self, command: Command) -> Command:
        self.received.append(command)
        if self.clock_runs:
            self.state = replace(self.state, time=self.state.time + self.period)
        return command
