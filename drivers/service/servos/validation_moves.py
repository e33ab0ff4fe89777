"""The moves by which a servo is validated, and what is measured of them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from drivers.control_loop import Cycle
from drivers.service.servos.validation import Check, Validation
from drivers.service.servos.waypoints import SETTLE_TIME
from drivers.state import Command, State
from robots import Robot
from robots.quaternion import Array

SLOW = math.radians(30.0)  # rad/s at most, of the slow ramp: lag grows with speed
HOLD_TIME, JUMP_MARGIN = 1.0, 0.5  # s
TURN = 2.0 * math.pi

LAG = math.radians(5.0)  # behind a slow ramp, of a position loop without integral
SLIP = math.radians(3.0)  # of a held servo
OVERSHOOT = math.radians(3.0)  # beyond the range of its targets
SPEED_MARGIN = 1.25  # of a servo that catches up
SPEED_STEP = math.radians(3.0)  # rad/s, two counts of Present Velocity


@dataclass(frozen=True)
class Move:
    """Targets of one joint, one for each cycle."""

    check: Check
    targets: Array
    """[rad], (T,)"""


@dataclass(frozen=True)
class SwingRange:
    """Angles within which a servo is validated."""

    center: float
    """[rad]"""
    swing: float
    """To each side [rad]."""

    @property
    def ends(self) -> tuple[float, float]:
        """Return its lower and upper end [rad]."""
        return self.center - self.swing, self.center + self.swing


def choose_swing_range(start: float, swing: float, lower: float, upper: float) -> SwingRange:
    """Choose the swing_range around an angle that is within a range, all in rad."""
    swing = min(swing, 0.5 * (upper - lower))
    return SwingRange(float(np.clip(start, lower + swing, upper - swing)), swing)


def plan_moves(
    swing_range: SwingRange, start: float, speed: float, period: float
) -> tuple[Move, ...]:
    """Plan all moves of a servo from an angle [rad], at most at a speed [rad/s]."""
    lower, upper = swing_range.ends
    corners = pairwise((start, upper, lower, upper))
    ramp = [_ramp(a, b, min(0.5 * speed, SLOW) * period) for a, b in corners]
    jump_time = 2.0 * swing_range.swing / speed + JUMP_MARGIN
    return (
        Move(Check.FOLLOWS, np.concatenate([*ramp, np.full(_count(SETTLE_TIME, period), upper)])),
        Move(Check.HOLDS, np.full(_count(HOLD_TIME, period), upper)),
        Move(Check.VELOCITY_LIMIT, np.full(_count(jump_time, period), lower)),
        Move(Check.WRAPAROUND, np.full(_count(jump_time, period), lower + TURN)),
        Move(Check.TORQUE_LIMIT, np.full(_count(JUMP_MARGIN, period), swing_range.center)),
    )


class MovesController:
    """Plays the moves of one joint, all others limp, and keeps what was measured."""

    def __init__(
        self, robot: Robot, joint: int, moves: Sequence[Move], torque_limit: float
    ) -> None:
        """Prepare to move a joint, given by its number, with a torque limit [N·m]."""
        self._robot, self._joint = robot, joint
        self._targets = np.concatenate([move.targets for move in moves])
        self._torque = np.zeros(robot.n)
        self._torque[joint] = torque_limit
        self._step = 0

    @property
    def done(self) -> bool:
        """Return whether all targets were sent."""
        return self._step == len(self._targets)

    def reset(self, state: State) -> None:
        """Start with the first target."""
        del state
        self._step = 0

    def step(self, state: State) -> Command:
        """Send the next target."""
        target = state.joint_pos.copy()
        target[self._joint] = self._targets[self._step]
        self._step += 1
        return Command.position(self._robot, target, self._torque)


@dataclass
class MoveLog:
    """Angles and speeds of one joint in each cycle."""

    joint: int
    wanted: list[float] = field(default_factory=list)
    """Targets that were sent [rad]."""
    position: list[float] = field(default_factory=list)
    """Measured before them [rad]."""
    velocity: list[float] = field(default_factory=list)
    """[rad/s]"""

    def note(self, cycle: Cycle) -> None:
        """Note a cycle."""
        self.wanted.append(float(cycle.sent.joint_pos[self.joint]))
        self.position.append(float(cycle.state.joint_pos[self.joint]))
        self.velocity.append(float(cycle.state.joint_vel[self.joint]))


def judge_moves(
    moves: Sequence[Move], log: MoveLog, swing_range: SwingRange, speed: float, reason: str
) -> list[Validation]:
    """Judge what was measured during each move; ``reason`` says why a move is missing."""
    wanted, position = np.array(log.wanted), np.array(log.position)
    velocity, ends = np.array(log.velocity), np.cumsum([len(move.targets) for move in moves])
    part = {
        move.check: slice(end - len(move.targets), end)
        for move, end in zip(moves, ends.tolist(), strict=True)
        if end <= len(position)
    }
    error, excess = (
        np.abs(position - wanted),
        np.abs(position - swing_range.center) - swing_range.swing,
    )

    def judge(check: Check, values: Array, limit: float, unit: str, remark: str) -> Validation:
        if check not in part:
            return Validation(check=check, measured=None, limit=limit, unit=unit, remark=reason)
        largest = float(np.degrees(values[part[check]].max()))
        return Validation(check=check, measured=largest, limit=limit, unit=unit, remark=remark)

    within = np.maximum(excess, 0.0)
    part[Check.STAYS_WITHIN] = slice(None)
    if not len(position):
        part.clear()
    fastest = SPEED_MARGIN * speed + SPEED_STEP
    return [
        judge(Check.FOLLOWS, error, math.degrees(LAG), "°", "behind its target"),
        judge(Check.HOLDS, error, math.degrees(SLIP), "°", f"from its target in {HOLD_TIME:g} s"),
        judge(Check.VELOCITY_LIMIT, np.abs(velocity), math.degrees(fastest), "°/s", "after a jump"),
        judge(
            Check.WRAPAROUND,
            within,
            math.degrees(OVERSHOOT),
            "°",
            "beyond the range, target a turn further",
        ),
        judge(Check.STAYS_WITHIN, within, math.degrees(OVERSHOOT), "°", "beyond the range, at all"),
    ]


def _ramp(start: float, end: float, step: float) -> Array:
    return np.linspace(start, end, max(2, math.ceil(abs(end - start) / step) + 1))[1:]


def _count(duration: float, period: float) -> int:
    return max(1, math.ceil(duration / period))
