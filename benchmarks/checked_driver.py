"""Comparison of a driver's reports with its virtual servos, for benchmarks."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from drivers import Command, State
from drivers.dynamixel.backend import DriverOptions, DynamixelBackend
from drivers.servo_units import ServoUnits
from drivers.virtual_bus.servo_physics import ServoPhysics
from drivers.virtual_bus.virtual_ports import VirtualPorts
from drivers.virtual_bus.virtual_robot import VirtualRobot
from robots.quaternion import Array
from robots.servo import RAD_PER_TICK


@dataclass(frozen=True)
class ServoSnapshot:
    """State of a virtual robot's servos after a physics step."""

    time: float
    """Bus time [s]."""
    torque_on: np.ndarray
    """Which servos have torque on, (n,)."""
    target: Array
    """Targets [rad], (n,)."""
    ticks: Array
    """Encoder counts as angles [rad], (n,)."""


class ServoTrace:
    """Snapshots of a virtual robot's servos after every physics step."""

    def __init__(self, physics: ServoPhysics) -> None:
        """Start to record the physics of a virtual robot."""
        self._physics, self._robot = physics, physics.simulation.robot
        self._units = ServoUnits(self._robot)
        self.snapshots: list[ServoSnapshot] = []
        physics.on_sense.append(self._record)

    def _record(self) -> None:
        drives = [motor.motor_command() for motor in self._physics.motors]
        self.snapshots.append(
            ServoSnapshot(
                time=self._physics.time,
                torque_on=np.array([drive.torque_on for drive in drives]),
                target=self._units.to_rad(np.array([drive.target_ticks for drive in drives])),
                ticks=self._units.quantize(self._physics.simulation.joint_pos),
            )
        )

    def count_beyond_limits(self) -> int:
        """Count targets outside the joint ranges, of servos with torque on.

        The target of a joint that was outside its range may be where the joint is, or further
        inside.
        """
        robot, beyond = self._robot, 0
        for before, now in pairwise(self.snapshots):
            lower = np.minimum(robot.lower, before.ticks) - RAD_PER_TICK
            upper = np.maximum(robot.upper, before.ticks) + RAD_PER_TICK
            beyond += int(np.sum(now.torque_on & ((now.target < lower) | (now.target > upper))))
        return beyond

    def find_safe_time(self, since: float) -> float | None:
        """Find the time from ``since`` [s] until torque was off or the servos held for good.

        A servo that holds its last target because it cannot be reached is safe as well.
        ``None`` if the servos never became safe.
        """
        later = [s for s in self.snapshots if s.time > since]
        safe: float | None = None
        for before, now in pairwise(later):
            moves = now.torque_on & before.torque_on & (now.target != before.target)
            begins = now.torque_on & ~before.torque_on
            if moves.any() or begins.any():
                safe = None
            elif safe is None:
                safe = before.time
        return safe if safe is None else max(safe - since, 0.0)


class CheckedDriver(DynamixelBackend):
    """A driver that compares its reports with the virtual robot behind it, in lock-step.

    In lock-step nothing happens between a reply and the next request, so values that the
    driver reports as fresh must equal the encoder counts, tick for tick.
    """

    def __init__(self, virtual: VirtualRobot, ports: VirtualPorts, **options: Any) -> None:
        """Drive a virtual robot; the options are those of `DynamixelBackend`."""
        own = DriverOptions(make_port=ports.make_port)
        super().__init__(virtual.robot, ports.paths, options=own, **options)
        self._virtual, self._virtual_ports = virtual, ports
        self.trace = ServoTrace(virtual.physics)
        self.too_fast = 0
        """Number of targets that moved faster than the joint's maximum speed."""
        self._sent: Command | None = None
        self._measured = np.zeros(virtual.robot.n)
        self.believed_wrong: list[str] = []
        """Wrong values that the driver reported as fresh."""

    def read(self) -> State:
        """Measure, and compare with the ground truth."""
        seen, before = len(self.trace.snapshots), self._read_encoders()
        state = super().read()
        # Time passes while a reply is missing: the value at any time of the reading is true.
        moments = [
            before,
            *(snapshot.ticks for snapshot in self.trace.snapshots[seen:]),
            self._read_encoders(),
        ]
        low, high = np.min(moments, axis=0), np.max(moments, axis=0)
        off = np.maximum(low - state.joint_pos, state.joint_pos - high)
        self._measured = state.joint_pos
        wrong = (state.joint_age == 0.0) & (off > 0.5 * RAD_PER_TICK)
        self.believed_wrong += [
            f"{state.time:.3f} s: joint '{self.robot.joint_names[i]}' at "
            f"{state.joint_pos[i]:+.4f} rad, truly {high[i]:+.4f} rad"
            for i in np.flatnonzero(wrong)
        ]
        return state

    def _read_encoders(self) -> Array:
        return self._virtual_ports.main.call(
            lambda: self._units.quantize(self._virtual.simulation.joint_pos)
        )

    def write(self, command: Command) -> Command:
        """Send a command; count targets that move faster than their joints can."""
        sent = super().write(command)
        before, self._sent = self._sent, sent
        if before is not None:
            driven = (before.torque_limit > 0.0) & (sent.torque_limit > 0.0)
            reach = self.robot.max_velocity * self.period + RAD_PER_TICK
            # A target that leaps to where its joint is moves nothing, as after a pause.
            leaps = np.abs(sent.joint_pos - self._measured) > reach
            jumps = leaps & (np.abs(sent.joint_pos - before.joint_pos) > reach)
            self.too_fast += int(np.sum(driven & jumps))
        return sent
