"""A flight log of a robot that swings its joints on the twin."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from drivers import Command, Cycle, Ending, GuardLimits, SafetyGuard, State, Twin, run
from drivers.flight_log.writer import FlightLog
from humanoid_getup.simulation.world import World
from robots import Posture, Robot
from robots.servo import LimitMode

SECOND = 1.0


class Swing:
    """Swing all joints about where they were."""

    done = False

    def __init__(self, robot: Robot, rate: float = 6.0) -> None:
        self.robot, self.rate = robot, rate

    def reset(self, state: State) -> None:
        self.middle = state.joint_pos

    def step(self, state: State) -> Command:
        angle = 0.5 * np.sin(self.rate * state.time + np.arange(self.robot.n))
        return Command.position(self.robot, self.middle + angle, torque_limit=1.5)


def twin_of(robot: Robot, voltage: float | None = None, limit_by: LimitMode | None = None) -> Twin:
    return Twin(World(robot), voltage=voltage, limit_by=limit_by)


def record_swing(
    path: Path,
    robot: Robot,
    twin: Twin,
    start: Posture | None,
    spoil: Callable[[Cycle], Cycle] | None = None,
    rate: float = 6.0,
    events: Sequence[tuple[str, str]] = (("phase", "over"),),
) -> None:
    guard = SafetyGuard(twin, GuardLimits.of(robot, torque_limit=1.0))
    with FlightLog(path, robot, start=start) as log:
        see = (lambda cycle: log.log(spoil(cycle))) if spoil else log.log
        report = run(Swing(robot, rate), guard, max_time=SECOND, on_cycle=see)
        for kind, text in events:
            log.event(report.duration, kind, text)
    assert report.ending is Ending.TIMEOUT
