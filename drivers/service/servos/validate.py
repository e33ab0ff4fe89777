"""Validates a servo: moves it guarded, falls silent, releases it, and times its replies."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from drivers.control_loop import Ending, RunReport, engaged, run_engaged
from drivers.dynamixel.backend import DynamixelBackend
from drivers.dynamixel.bus import DynamixelBus
from drivers.dynamixel.clock import Clock
from drivers.dynamixel.control_table import table_named
from drivers.dynamixel.diagnostics import NO_WATCHDOG
from drivers.dynamixel.goal_ranges import full_scale
from drivers.dynamixel.robot_bus import find_bus
from drivers.dynamixel.servo_states import TRIPPED
from drivers.safety_guard import SafetyGuard
from drivers.safety_limits import GuardLimits
from drivers.service.servos.guarded_motion import MovedServos
from drivers.service.servos.loose_servo import open_bus
from drivers.service.servos.validation import Check, Validation
from drivers.service.servos.validation_moves import (
    MoveLog,
    MovesController,
    SwingRange,
    choose_swing_range,
    judge_moves,
    plan_moves,
)
from robots import Joint

SILENCE = 1.5  # times of the watchdog, after which a servo must have stopped
TIMEOUT_SHARE = 3.0  # of the moves' time
READS = 100
LONGEST_REPLY = 5.0  # ms; an adapter that waits for 16 ms (latency_timer) takes longer
SILENT = "it does not reply"
SWING, SPEED = math.radians(20.0), math.radians(60.0)


class ServoValidator:
    """Validates the chosen servos one after the other, all others limp.

    Each move goes through a guard whose range and speed are those of the validation.
    """

    def __init__(
        self,
        servos: MovedServos,
        *,
        swing: float = SWING,
        speed: float = SPEED,
        clock: Clock | None = None,
        pause: Callable[[float], None] = time.sleep,
    ) -> None:
        """Prepare to validate.

        Args:
            servos: The servos, and their torque.
            swing: Angle to each side of where a servo is [rad].
            speed: Highest speed of targets [rad/s].
            clock: Clock of the measurements; None for wall time.
            pause: Waits for some seconds without a byte on the bus.
        """
        self._servos, self._swing, self._speed = servos, swing, speed
        self._clock, self._pause = clock or Clock(), pause
        self._robot = servos.robot
        self._guard: SafetyGuard | None = None
        self._stop_reason: str | None = None

    def stop(self, reason: str) -> None:
        """Switch torque off and end all moves; any thread may call."""
        self._stop_reason = reason
        if self._guard is not None:
            self._guard.stop(reason)

    def validate(self, joint: int) -> list[Validation]:
        """Validate the servo of a joint, given by its number; its torque is off afterwards.

        Raises:
            DriverError: if the servos cannot be connected to, or do not confirm torque off.
        """
        with SafetyGuard(self._servos.make_backend(self._clock)) as guard:
            start = float(guard.read().joint_pos[joint])
        swing_range = choose_swing_range(
            start, self._swing, self._robot.lower[joint], self._robot.upper[joint]
        )
        backend = self._servos.make_backend(self._clock)
        guard = self._guard = SafetyGuard(backend, self._limit(joint, swing_range))
        if self._stop_reason is not None:
            guard.stop(self._stop_reason)
        with engaged(guard, realtime=self._clock.is_real):
            results = self._move(guard, backend, joint, start, swing_range)
        return results + self._check_after(joint)

    def _limit(self, joint: int, swing_range: SwingRange) -> GuardLimits:
        """Make the guard's limits: the swing_range of the joint, and the speed."""
        limits = GuardLimits.of(self._robot)
        lower, upper = limits.lower.copy(), limits.upper.copy()
        lower[joint], upper[joint] = swing_range.ends
        return replace(
            limits,
            lower=lower,
            upper=upper,
            max_velocity=np.minimum(limits.max_velocity, self._speed),
        )

    def _move(
        self,
        guard: SafetyGuard,
        backend: DynamixelBackend,
        joint: int,
        start: float,
        swing_range: SwingRange,
    ) -> list[Validation]:
        speed = float(guard.limits.max_velocity[joint])
        moves = plan_moves(swing_range, start, speed, guard.period)
        log = MoveLog(joint)
        torque = float(self._servos.torque_limit[joint])
        controller = MovesController(self._robot, joint, moves, torque)
        most = TIMEOUT_SHARE * sum(len(move.targets) for move in moves) * guard.period
        report = run_engaged(
            controller, guard, max_time=most, realtime=self._clock.is_real, on_cycle=log.note
        )
        return [
            *judge_moves(moves, log, swing_range, speed, report.reason),
            *self._check_registers(backend, joint, report),
        ]

    def _check_registers(
        self, backend: DynamixelBackend, joint: int, report: RunReport
    ) -> list[Validation]:
        """Check torque limit and watchdog in a servo that holds, after the last command."""
        device = self._robot.joints[joint]
        bus = next(chain.bus for chain in backend.chains if device in chain.joints)
        limit = float(self._servos.torque_limit[joint])
        longest = SILENCE * find_bus(self._robot).watchdog
        if report.ending is not Ending.DONE:
            return [
                _miss(Check.TORQUE_LIMIT, limit, "N·m", report.reason),
                _miss(Check.WATCHDOG, longest, "s", report.reason),
            ]
        torque = self._read_torque(backend, bus, joint)
        if not table_named(device.servo.model.name).has_watchdog:
            missing = _miss(Check.WATCHDOG, longest, "s", NO_WATCHDOG[0])
            return [torque, replace(missing, applies=False)]
        self._pause(longest)
        state = _read(bus, device, "bus_watchdog")
        stopped = state is not None and state & 0xFF == TRIPPED
        remark = "of silence, and it has stopped" if stopped else "it goes on without a command"
        return [
            torque,
            Validation(
                check=Check.WATCHDOG,
                measured=longest if stopped else None,
                limit=longest,
                unit="s",
                remark=SILENT if state is None else remark,
            ),
        ]

    def _read_torque(self, backend: DynamixelBackend, bus: DynamixelBus, joint: int) -> Validation:
        """Read the torque that a servo may use now."""
        robot, by_current = self._robot, backend.limit_by == "current"
        limit = float(self._servos.torque_limit[joint])
        register = "goal_current" if by_current else "goal_pwm"
        counts = _read(bus, robot.joints[joint], register)
        if counts is None:
            return _miss(Check.TORQUE_LIMIT, limit, "N·m", SILENT)
        table = table_named(robot.joints[joint].servo.model.name)
        torque = counts / full_scale(table) * robot.max_torque[joint]
        if by_current:
            torque = counts * robot.current_step[joint] * robot.torque_per_ampere[joint]
        return Validation(
            check=Check.TORQUE_LIMIT,
            measured=float(torque),
            limit=limit,
            unit="N·m",
            remark=f"{register} is {counts}",
        )

    def _check_after(self, joint: int) -> list[Validation]:
        """Check a servo that was let go."""
        device, settings = self._robot.joints[joint], find_bus(self._robot)
        name = next(port for port, names in settings.ports.items() if device.name in names)
        wire = table_named(device.servo.model.name).wire
        with open_bus(self._servos.ports[name], settings.baud, wire.name) as bus:
            torque = _read(bus, device, "torque_enable")
            return [
                Validation(
                    check=Check.TORQUE_OFF,
                    measured=torque,
                    limit=0.0,
                    unit="",
                    remark=SILENT if torque is None else f"torque_enable is {torque}",
                ),
                _time_replies(bus, device),
            ]


def _time_replies(bus: DynamixelBus, device: Joint) -> Validation:
    """Time single reads of a position, beyond the time of their bytes; all must be answered."""
    before = replace(bus.statistics)
    item = table_named(device.servo.model.name)["present_position"]
    durations: list[float] = []
    for _ in range(READS):
        began = time.perf_counter()
        if bus.read_item(device.servo.id, item, tries=1) is None:
            remark = f"no reply to read {len(durations) + 1} of {READS}"
            return _miss(Check.REPLY_TIME, 1000.0 * bus.answer_margin, "ms", remark)
        durations.append(1000.0 * (time.perf_counter() - began))
    traffic = bus.statistics - before
    wire = 1000.0 * (traffic.bytes_in + traffic.bytes_out) / READS * bus.byte_time
    median, slowest = np.percentile(durations, (50, 99))
    return Validation(
        check=Check.REPLY_TIME,
        measured=max(float(median) - wire, 0.0),
        limit=LONGEST_REPLY,
        unit="ms",
        remark=f"beyond {wire:.1f} ms of bytes, median of {READS}; 99 % {slowest - wire:.1f} ms",
    )


def _read(bus: DynamixelBus, device: Joint, register: str) -> int | None:
    return bus.read_item(device.servo.id, table_named(device.servo.model.name)[register])


def _miss(check: Check, limit: float, unit: str, reason: str) -> Validation:
    return Validation(check=check, measured=None, limit=limit, unit=unit, remark=reason)
