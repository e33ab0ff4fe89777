"""A backend around a backend, for benchmarks that look on."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from drivers import Backend, Command, State
from drivers.backend import ClosesItself
from drivers.servo_units import ServoUnits
from drivers.virtual_bus.virtual_robot import VirtualPorts, VirtualRobot
from robots import Robot
from robots.quaternion import Array
from robots.servo import RAD_PER_TICK


class ObservingBackend(ClosesItself):
    """Hands everything through; who looks on overrides what it wants to see."""

    def __init__(self, backend: Backend) -> None:
        """Look on at a backend."""
        self._backend = backend

    @property
    def robot(self) -> Robot:
        """Return the robot."""
        return self._backend.robot

    @property
    def period(self) -> float:
        """Return the control period [s]."""
        return self._backend.period

    def connect(self) -> None:
        """Open the backend."""
        self._backend.connect()

    def close(self) -> None:
        """Close the backend."""
        self._backend.close()

    def read(self) -> State:
        """Measure."""
        return self._backend.read()

    def write(self, command: Command) -> Command:
        """Send a command."""
        return self._backend.write(command)


@dataclass(frozen=True)
class Sight:
    """The end of a stretch of physics, as the servos live it."""

    time: float
    """Bus time [s]."""
    torque_on: np.ndarray
    """Which servos drive, (n,)."""
    target: Array
    """Where they aim [rad], (n,)."""
    ticks: Array
    """What their encoders tell, as angles [rad], (n,)."""


class Sights:
    """Every stretch of a virtual robot's life, seen where physics is."""

    def __init__(self, virtual: VirtualRobot) -> None:
        """Watch a virtual robot from now on."""
        self._virtual = virtual
        self._units = ServoUnits(virtual.robot)
        self.seen: list[Sight] = []
        virtual.physics.on_advance.append(self._look)

    def _look(self) -> None:
        drives = [servo.motor_command() for servo in self._virtual.servos]
        self.seen.append(
            Sight(
                time=self._virtual.physics.time,
                torque_on=np.array([drive.torque_on for drive in drives]),
                target=self._units.to_rad(np.array([drive.target_ticks for drive in drives])),
                ticks=self._units.quantize(self._virtual.simulation.joint_pos),
            )
        )

    def count_beyond_limits(self) -> int:
        """Count the targets of driven servos outside their ranges.

        A joint that lay outside may aim where it lies, or back.
        """
        robot, beyond = self._virtual.robot, 0
        for before, now in pairwise(self.seen):
            lower = np.minimum(robot.lower, before.ticks) - RAD_PER_TICK
            upper = np.maximum(robot.upper, before.ticks) + RAD_PER_TICK
            beyond += int(np.sum(now.torque_on & ((now.target < lower) | (now.target > upper))))
        return beyond

    def find_safe_time(self, since: float) -> float | None:
        """Find when the robot was limp or held for good, after a bus time [s]; None for never.

        A servo that nobody reaches any more and that holds its last target is safe as well.
        """
        later = [sight for sight in self.seen if sight.time > since]
        safe: float | None = None
        for before, now in pairwise(later):
            moves = now.torque_on & before.torque_on & (now.target != before.target)
            begins = now.torque_on & ~before.torque_on
            if moves.any() or begins.any():
                safe = None
            elif safe is None:
                safe = before.time
        return safe if safe is None else max(safe - since, 0.0)


class Witness(ObservingBackend):
    """A backend around a backend of a virtual robot in lock-step, that compares.

    In lock-step nothing happens between an answer and the next request, so what the
    driver calls fresh must be what the encoders tell, tick for tick.
    """

    def __init__(self, backend: Backend, robot: VirtualRobot, ports: VirtualPorts) -> None:
        """Watch a virtual robot and the backend that drives it."""
        super().__init__(backend)
        self._virtual, self._ports = robot, ports
        self._units = ServoUnits(robot.robot)
        self.sights = Sights(robot)
        self.too_fast = 0
        """Targets sent that moved further in a period than the joint's top speed allows."""
        self._sent: Command | None = None
        self.believed_wrong: list[str] = []
        """Each value that the driver called fresh and that was not true."""

    def read(self) -> State:
        """Measure, and compare with the truth."""
        seen, before = len(self.sights.seen), self._measure()
        state = super().read()
        # Waiting for what never comes lets time pass: any moment of the reading is true.
        moments = [before, *(sight.ticks for sight in self.sights.seen[seen:]), self._measure()]
        low, high = np.min(moments, axis=0), np.max(moments, axis=0)
        off = np.maximum(low - state.joint_pos, state.joint_pos - high)
        wrong = (state.joint_age == 0.0) & (off > 0.5 * RAD_PER_TICK)
        self.believed_wrong += [
            f"{state.time:.3f} s: joint '{self.robot.joint_names[i]}' at "
            f"{state.joint_pos[i]:+.4f} rad, truly {high[i]:+.4f} rad"
            for i in np.flatnonzero(wrong)
        ]
        return state

    def _measure(self) -> Array:
        return self._ports.main.call(
            lambda: self._units.quantize(self._virtual.simulation.joint_pos)
        )

    def write(self, command: Command) -> Command:
        """Send a command; count the targets that move faster than their joints can."""
        sent = super().write(command)
        before, self._sent = self._sent, sent
        if before is not None:
            driven = (before.torque_limit > 0.0) & (sent.torque_limit > 0.0)
            reach = self.robot.max_velocity * self.period + RAD_PER_TICK
            jumps = np.abs(sent.joint_pos - before.joint_pos) > reach
            self.too_fast += int(np.sum(driven & jumps))
        return sent
