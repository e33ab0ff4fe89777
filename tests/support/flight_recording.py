"""Flight logs: of a robot that swings its joints on the twin, and of made-up cycles."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from recording_backend import still_state

from drivers import (
    ClipCounts,
    Command,
    Cycle,
    Ending,
    GuardLimits,
    Guidance,
    SafetyGuard,
    State,
    Twin,
    run,
)
from drivers.control_loop import Timing
from drivers.flight_log.writer import FlightLog
from humanoid_getup.simulation.world import World
from robots import Posture, Robot, quaternion
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


def make_cycle(robot: Robot, number: int, first: float = 0.0, **changes: Any) -> Cycle:
    """Make up a cycle of which every value is another."""
    n, rng = robot.n, np.random.default_rng(number)
    state = still_state(
        robot,
        time=first + number * robot.control_period,
        joint_pos=rng.normal(size=n),
        joint_vel=rng.normal(size=n),
        joint_current=rng.normal(size=n),
        gyro=rng.normal(size=3),
        orientation=quaternion.normalize(rng.normal(size=4)),
        joint_age=rng.random(n),
        alert=rng.integers(0, 64, n),
        voltage=float(rng.normal(12.0)),
    )
    command = Command(
        joint_pos=rng.normal(size=n),
        gain_scale=rng.random(n),
        torque_limit=rng.random(n),
        pwm_limit=rng.random(n),
    )
    clips = ClipCounts(*rng.integers(0, 9, (5, n)))
    timing = Timing(late=0.0, read=float(rng.random()), step=1e-300, write=0.1 + 0.2)
    sent = replace(command, joint_pos=-command.joint_pos)
    guidance = Guidance(wanted=rng.normal(size=3), measured=rng.normal(size=3))
    return replace(Cycle(state, command, sent, clips, timing, guidance), **changes)


def write_flight(path: Path, robot: Robot, cycles: Iterable[Cycle]) -> None:
    with FlightLog(path, robot) as log:
        for cycle in cycles:
            log.log(cycle)
