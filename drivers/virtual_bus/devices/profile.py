"""Profiles: how position goals of a servo are approached over time."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import IntEnum

from drivers.virtual_bus.devices.registers import MAX_COUNTS, Registers, clamp
from robots.servo import RAD_PER_TICK


class ProfileShape(IntEnum):
    """Bits 4 and 5 of Moving Status."""

    STEP = 0
    RECTANGLE = 1
    TRIANGLE = 2
    TRAPEZOID = 3


@dataclass(frozen=True)
class ProfileTrajectory:
    """Positions over time [ticks], from ``start`` on."""

    start: float
    """[s]"""
    position: float
    velocity: float
    """At the start [ticks/s]."""
    goal: float
    cruise: float = 0.0
    """Velocity between the two ramps [ticks/s]."""
    speed_up: float = 0.0
    """Duration of the first ramp [s]."""
    hold: float = 0.0
    """Duration of the cruise [s]."""
    slow_down: float = 0.0
    """Duration of the last ramp [s]."""
    shape: ProfileShape = ProfileShape.STEP

    @property
    def end(self) -> float:
        """Return the time at which the goal is reached [s]."""
        return self.start + self.speed_up + self.hold + self.slow_down

    def at(self, now: float) -> tuple[float, float]:
        """Compute position [ticks] and velocity [ticks/s]."""
        t = max(now - self.start, 0.0)
        if now >= self.end:
            return self.goal, 0.0
        if t < self.speed_up:
            velocity = self.velocity + (self.cruise - self.velocity) * t / self.speed_up
            return self.position + 0.5 * (self.velocity + velocity) * t, velocity
        position = self.position + 0.5 * (self.velocity + self.cruise) * self.speed_up
        t -= self.speed_up
        if t < self.hold:
            return position + self.cruise * t, self.cruise
        position += self.cruise * self.hold
        t -= self.hold
        if t >= self.slow_down:
            return self.goal, 0.0  # rounding at the very end
        velocity = self.cruise * (1.0 - t / self.slow_down)
        return position + 0.5 * (self.cruise + velocity) * t, velocity


def plan_by_velocity(
    start: float, position: float, velocity: float, goal: float, top: float, acceleration: float
) -> ProfileTrajectory:
    """Plan the fastest trajectory from now [s] to a goal, in ticks and seconds; 0 for no limit."""
    if top <= 0.0:
        return ProfileTrajectory(start, goal, 0.0, goal)
    way = goal - position
    if acceleration <= 0.0:
        cruise = math.copysign(top, way)
        hold = abs(way) / top
        return ProfileTrajectory(
            start, position, cruise, goal, cruise, hold=hold, shape=ProfileShape.RECTANGLE
        )
    # If braking now overshoots the goal, the trajectory turns back.
    stop = velocity * abs(velocity) / (2.0 * acceleration)
    side = math.copysign(1.0, way - stop)
    v, d = side * velocity, side * way
    peak = math.sqrt(max(0.5 * v * v + acceleration * d, 0.0))
    cruise = min(peak, top)
    speed_up = abs(cruise - v) / acceleration
    slow_down = cruise / acceleration
    ramps = 0.5 * (v + cruise) * speed_up + 0.5 * cruise * slow_down
    hold = max(d - ramps, 0.0) / cruise if peak > top else 0.0
    shape = ProfileShape.TRAPEZOID if peak > top else ProfileShape.TRIANGLE
    return ProfileTrajectory(
        start, position, velocity, goal, side * cruise, speed_up, hold, slow_down, shape
    )


class PositionControl:
    """Follows goals by the profile registers and updates the trajectory registers."""

    def __init__(self, registers: Registers) -> None:
        self._registers = registers
        table = registers.table
        self._speed_scale = table["profile_velocity"].scale  # rad/s
        self._acceleration_scale = table["profile_acceleration"].scale  # rad/s²
        self.position = 0.0
        """Present position of the trajectory, as in the registers [ticks]."""
        self.running = False
        """True until the goal is reached."""
        self.shape = ProfileShape.STEP
        self._velocity = 0.0  # ticks/s
        self._trajectory: ProfileTrajectory | None = None

    def halt(self, position: float) -> None:
        """Hold a position [ticks]."""
        self.position, self._velocity = position, 0.0
        self._trajectory, self.running, self.shape = None, False, ProfileShape.STEP
        self._write()

    def aim(self, now: float, goal: float) -> None:
        """Start toward a position [ticks] by the profile registers."""
        velocity = self._registers["profile_velocity"]
        if not velocity:  # the usual case: no profile
            self.halt(goal)
            return
        self._trajectory = plan_by_velocity(
            now,
            self.position,
            self._velocity,
            goal,
            velocity * self._speed_scale / RAD_PER_TICK,
            self._registers["profile_acceleration"] * self._acceleration_scale / RAD_PER_TICK,
        )
        self.shape = self._trajectory.shape
        self.running = self._trajectory.end > now
        if not self.running:
            self.halt(goal)
        self._write()

    def advance(self, now: float) -> None:
        """Advance along the trajectory while ``running``."""
        if self._trajectory is not None:
            self.position, self._velocity = self._trajectory.at(now)
            self.running = now < self._trajectory.end
        self._write()

    def _write(self) -> None:
        speed_counts = round(self._velocity * RAD_PER_TICK / self._speed_scale)
        position = round(self.position)
        self._registers["velocity_trajectory"] = clamp(speed_counts, MAX_COUNTS)
        self._registers["position_trajectory"] = clamp(position, MAX_COUNTS)
