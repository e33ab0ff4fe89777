"""Moves one servo through the guard: of a robot, or alone on a port."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from drivers.dynamixel.backend import DriverOptions, DynamixelBackend
from drivers.dynamixel.bus import ANSWER_MARGIN
from drivers.dynamixel.clock import Clock
from drivers.dynamixel.configuration import list_eeprom_settings
from drivers.dynamixel.control_table import types_of
from drivers.dynamixel.cyclic_read import count_reads
from drivers.dynamixel.diagnostics import DiagnosticsError, Severity, diagnose
from drivers.errors import SetupError
from drivers.serial_port import read_latency
from drivers.service.loose_servo import LooseServo, open_servo
from drivers.state import Command, State
from robots import Joint, Robot
from robots.bench import ServoBench, choose_period, make_bench, make_bench_joint
from robots.description.servo_catalog import servo_models
from robots.servo import LimitMode
from robots.smooth_step import smooth_step

MARGIN_SHARE = 0.25  # of a bench's period, for which a reply may be late
PEAK_OF_SMOOTH_STEP = 1.5  # its largest slope


def find_bench(
    path: str,
    servo_id: int | None,
    baud: int | None,
    protocol: str | None,
    limit_by: LimitMode | None = None,
) -> tuple[ServoBench, Mapping[str, int]]:
    """Make a bench of one servo on a port; nothing is written, and the port is closed afterwards.

    Its range is that of the position limits that are stored in it. For the arguments see
    `open_servo`; torque limits act on ``limit_by``, None for what suits the servo.

    Returns:
        The bench, and the stored settings that the driver changes before it moves the servo.
    """
    with open_servo(path, servo_id, baud, protocol) as servo:
        found = diagnose(servo.bus, [_make_joint(servo)])
        blocking = [each for each in found.findings if each.severity is not Severity.WARNING]
        if blocking:
            raise DiagnosticsError(blocking)
        (facts,) = found.servos
        baud, reads = servo.bus.port.baud, count_reads([servo.table])
        period = choose_period(1, baud, read_latency(path), reads)
        bench = make_bench([facts.joint], baud=baud, control_period=period)
        bench = replace(bench, limit_by=limit_by or bench.limit_by)
    return bench, list_eeprom_settings(facts, bench.limit_by)


def _make_joint(servo: LooseServo) -> Joint:
    figures = servo_models()  # of types with one table, for different supplies
    types = [figures[name] for name in types_of(servo.table) if name in figures]
    counts = servo.read("present_input_voltage")
    supply = servo.table["present_input_voltage"].to_si(counts)
    model = next((model for model in types if model.accepts_supply(supply)), types[0])
    first, last = servo.read("min_position_limit"), servo.read("max_position_limit")
    if first >= last:
        raise SetupError(
            f"{servo.name}: min_position_limit is {first} and max_position_limit {last}, expected "
            "a range: getup servo write"
        )
    return make_bench_joint(
        model,
        servo.id,
        lower=(first - model.middle_tick) * model.rad_per_tick,
        upper=(last - model.middle_tick) * model.rad_per_tick,
        keeps_limits=True,
    )


def check_target(robot: Robot, joint: int, angle: float) -> None:
    """Check that a target [rad] is in the range of a joint, given by its number."""
    lower, upper = robot.lower[joint], robot.upper[joint]
    if not lower <= angle <= upper:
        degrees = np.degrees([angle, lower, upper])
        raise SetupError(
            f"joint '{robot.joint_names[joint]}': target is {degrees[0]:+.1f}°, expected "
            f"{degrees[1]:+.1f}° to {degrees[2]:+.1f}°"
        )


@dataclass(frozen=True, kw_only=True)
class Move:
    """Where one joint goes, and how."""

    joint: int
    """Its number."""
    target: float
    """Angle to go to, or by which to go [rad]."""
    is_relative: bool
    speed: float
    """Highest speed on the way [rad/s]."""
    torque_limit: float
    """[N·m]"""
    hold: float
    """Time for which it is held there [s]."""


class MoveController:
    """Moves a joint to its target with a smooth step, and holds it there; the others are limp."""

    def __init__(self, robot: Robot, move: Move, state: State) -> None:
        """Prepare to move a joint from where it is measured."""
        self._robot, self._move = robot, move
        self.start = self.angle = float(state.joint_pos[move.joint])
        """Angles before the move, and newest [rad]."""
        self.target = move.target + (self.start if move.is_relative else 0.0)
        """[rad]"""
        check_target(robot, move.joint, self.target)
        self._torque = np.zeros(robot.n)
        self._torque[move.joint] = move.torque_limit
        self.peak_current = 0.0
        """Largest motor current so far [A]."""
        self.done = False
        self.reset(state)

    def reset(self, state: State) -> None:
        """Start where the servos are."""
        self._began, self._origin = state.time, state.joint_pos.copy()
        self._way = self.target - float(self._origin[self._move.joint])
        self._duration = PEAK_OF_SMOOTH_STEP * abs(self._way) / self._move.speed

    @property
    def duration(self) -> float:
        """Return how long all of it takes [s]."""
        return self._duration + self._move.hold

    def step(self, state: State) -> Command:
        """Move towards the target."""
        joint, passed = self._move.joint, state.time - self._began
        self.angle = float(state.joint_pos[joint])
        self.peak_current = max(self.peak_current, abs(float(state.joint_current[joint])))
        self.done = passed >= self.duration
        share = smooth_step(np.array(passed / self._duration if self._duration else 1.0))
        target = self._origin.copy()
        target[joint] += share * self._way
        return Command.position(self._robot, target, self._torque)


def make_driver(
    robot: Robot, ports: Mapping[str, str], clock: Clock | None = None
) -> DynamixelBackend:
    """Make the driver of a robot or a bench, not connected yet; without a clock in wall time."""
    margin = None
    if isinstance(robot, ServoBench) and clock is None:  # beside any other work
        margin = max(ANSWER_MARGIN, MARGIN_SHARE * robot.control_period)
    options = DriverOptions(answer_margin=margin)
    without_imu = robot.imu_kind is None
    return DynamixelBackend(robot, ports, clock=clock, without_imu=without_imu, options=options)
