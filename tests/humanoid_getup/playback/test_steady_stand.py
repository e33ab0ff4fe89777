"""A steady stand lasts for a while and is slow at its end; a long one may sway."""

from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import numpy as np

from humanoid_getup.experiments.judging.standing import HOLD_TIME
from humanoid_getup.playback.simulated_play import STEADY_SPEED, STEADY_TIME, SteadyStand

PERIOD = 0.01


@dataclass
class Robot:
    upright: bool = True
    data: Any = field(default_factory=lambda: SimpleNamespace(qvel=np.zeros(6)))
    period: float = PERIOD


def watch(robot: Robot, seconds: float, stand: SteadyStand | None = None) -> SteadyStand:
    stand = stand or SteadyStand(robot, lambda: robot.upright)  # pyright: ignore[reportArgumentType]
    for _ in range(round(seconds / PERIOD)):
        stand.observe()
    return stand


def test_a_slow_robot_stands_steadily_after_a_while_and_not_before():
    assert not watch(Robot(), STEADY_TIME).is_reached
    assert watch(Robot(), STEADY_TIME + PERIOD).is_reached


def test_a_robot_that_sways_has_to_stand_for_as_long_as_a_held_stand():
    robot = Robot()
    robot.data.qvel[3] = -2.0 * STEADY_SPEED
    assert not watch(robot, HOLD_TIME).is_reached
    assert watch(robot, HOLD_TIME + PERIOD).is_reached


def test_a_break_begins_it_again():
    robot = Robot()
    stand = watch(robot, STEADY_TIME)
    robot.upright = False
    watch(robot, PERIOD, stand)
    robot.upright = True
    assert not watch(robot, STEADY_TIME, stand).is_reached
    assert watch(robot, PERIOD, stand).is_reached
