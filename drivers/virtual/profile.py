"""Profiles: how a servo's trajectory goes from where it is to a new goal.

A trajectory is a velocity that changes linearly to a cruising speed, stays, and changes
linearly to zero: a rectangle, a triangle or a trapezoid over time (e-manual, Profile
Acceleration and Profile Velocity).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import IntEnum


class Shape(IntEnum):
    """Bits 4 and 5 of Moving Status."""

    STEP = 0
    RECTANGLE = 1
    TRIANGLE = 2
    TRAPEZOID = 3


@dataclass(frozen=True)
class Trajectory:
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
    shape: Shape = Shape.STEP

    @property
    def end(self) -> float:
        """Return when the goal is reached [s]."""
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
            return self.goal, 0.0  # the last moment, lost in rounding
        velocity = self.cruise * (1.0 - t / self.slow_down)
        return position + 0.5 * (self.cruise + velocity) * t, velocity


def plan_step(start: float, goal: float) -> Trajectory:
    """Be at the goal at once."""
    return Trajectory(start, goal, 0.0, goal)


def plan_by_velocity(
    start: float, position: float, velocity: float, goal: float, top: float, acceleration: float
) -> Trajectory:
    """Go as fast as a top speed [ticks/s] and an acceleration [ticks/s²] allow.

    Args:
        start: Now [s].
        position: Where the trajectory is now [ticks].
        velocity: How fast it is now [ticks/s].
        goal: Where it ends, at rest [ticks].
        top: Cruising speed; 0 for no profile.
        acceleration: 0 for a jump to the cruising speed.
    """
    if top <= 0.0:
        return plan_step(start, goal)
    way = goal - position
    if acceleration <= 0.0:
        cruise = math.copysign(top, way)
        hold = abs(way) / top
        return Trajectory(start, position, cruise, goal, cruise, hold=hold, shape=Shape.RECTANGLE)
    # Braking now would end beyond the goal: then the way leads back.
    stop = velocity * abs(velocity) / (2.0 * acceleration)
    side = math.copysign(1.0, way - stop)
    v, d = side * velocity, side * way
    peak = math.sqrt(max(0.5 * v * v + acceleration * d, 0.0))
    cruise = min(peak, top)
    speed_up = abs(cruise - v) / acceleration
    slow_down = cruise / acceleration
    ramps = 0.5 * (v + cruise) * speed_up + 0.5 * cruise * slow_down
    hold = max(d - ramps, 0.0) / cruise if peak > top else 0.0
    shape = Shape.TRAPEZOID if peak > top else Shape.TRIANGLE
    return Trajectory(
        start, position, velocity, goal, side * cruise, speed_up, hold, slow_down, shape
    )


def plan_by_time(
    start: float, position: float, velocity: float, goal: float, total: float, ramp: float
) -> Trajectory:
    """Arrive after a given time.

    Args:
        start: Now [s].
        position: Where the trajectory is now [ticks].
        velocity: How fast it is now [ticks/s].
        goal: Where it ends, at rest [ticks].
        total: Duration of the motion [s]; 0 for no profile.
        ramp: Duration of each ramp [s]; no more than half of the whole counts.
    """
    if total <= 0.0:
        return plan_step(start, goal)
    ramp = min(ramp, 0.5 * total)
    way = goal - position
    if ramp <= 0.0:
        cruise = way / total
        return Trajectory(start, position, cruise, goal, cruise, hold=total, shape=Shape.RECTANGLE)
    cruise = (way - 0.5 * velocity * ramp) / (total - ramp)
    hold = total - 2.0 * ramp
    shape = Shape.TRAPEZOID if hold > 0.0 else Shape.TRIANGLE
    return Trajectory(start, position, velocity, goal, cruise, ramp, hold, ramp, shape)


def approach(value: float, goal: float, step: float) -> float:
    """Move a value towards a goal by one step at most."""
    return goal if abs(goal - value) <= step else value + math.copysign(step, goal - value)
