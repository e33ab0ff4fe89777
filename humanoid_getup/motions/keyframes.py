"""Keyframes: motions as hand-written key postures, before any physics."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import PchipInterpolator

from humanoid_getup.motions.motion import STANDING, EndClass, StartClass, hold_last
from robots import Robot
from robots.quaternion import Array

STRETCHES, MOST_STRETCHES = 4, 50
SPEED_SHARE = 0.9  # of the servos' no-load speed, the bound of a target's speed


@dataclass(frozen=True, kw_only=True)
class Keyframes:
    """Key postures of one motion, in time."""

    name: str
    start_class: StartClass
    """Posture class it starts from: supine, prone, left, right, squat or standing."""
    end_class: EndClass = STANDING
    """What it ends in: a held stand, or the side on which the robot lies."""
    strategy: str
    """The strategy, in terms of biomechanics."""
    duration: Array
    """Time from each key to the next [s], shape (K-1,)."""
    keys: Array
    """Joint targets [rad], shape (K, n); the last of a rise is the standing posture."""
    free: np.ndarray
    """Joints that the optimization may change, shape (m,): left or unpaired ones."""
    mirrored: np.ndarray
    """Whether the right-hand partner of each free joint mirrors it, shape (m,)."""
    torque_limit: float
    """Torque limit of every servo in the optimization [N·m]."""
    time_cost: float
    """Cost of a second until the stand in the optimization."""
    torque_cost: float
    """Cost of a newton meter of RMS torque there."""

    def targets(self, robot: Robot, hold: float) -> Array:
        """Sample the joint targets at the control period, then hold the last, (T, n).

        A segment that would need targets faster than the servos is stretched.
        """
        _, curve, time = self._slow_down(robot, STRETCHES)
        moving = np.clip(curve(time), robot.lower, robot.upper)
        return hold_last(moving, len(moving) + round(hold / robot.control_period))

    def times(self, robot: Robot) -> Array:
        """Compute the times from the start at which `targets` reaches the keys [s], (K,)."""
        return np.concatenate([[0.0], np.cumsum(self._slow_down(robot, STRETCHES)[0])])

    def stretch(self, robot: Robot) -> Keyframes:
        """Give all segments the time that the servos need, so that none is stretched any more."""
        return replace(self, duration=self._slow_down(robot, MOST_STRETCHES)[0])

    def _slow_down(self, robot: Robot, rounds: int) -> tuple[Array, PchipInterpolator, Array]:
        """Stretch segments that are too fast; return durations, and the last curve, sampled at."""
        duration = self.duration
        curve, time, stretch = self._measure_speed(duration, robot)
        while np.any(stretch > 1.0) and (rounds := rounds - 1):
            duration = duration * np.maximum(1.0, stretch)
            curve, time, stretch = self._measure_speed(duration, robot)
        return duration, curve, time

    def _measure_speed(
        self, duration: Array, robot: Robot
    ) -> tuple[PchipInterpolator, Array, Array]:
        """Return curve and sample times for durations, and each segment's speed over the bound."""
        knots = np.concatenate([[0.0], np.cumsum(duration)])
        curve = PchipInterpolator(knots, self.keys, axis=0)
        time = np.arange(0.0, knots[-1] + robot.control_period, robot.control_period)
        time = np.minimum(time, knots[-1])
        excess = np.max(np.abs(curve(time, 1)) / (SPEED_SHARE * robot.max_velocity), axis=1)
        segment = np.minimum(np.searchsorted(knots, time, side="right") - 1, len(duration) - 1)
        stretch = np.zeros(len(duration))
        np.maximum.at(stretch, segment, excess)
        return curve, time, stretch

    @property
    def genes(self) -> Array:
        """Return the parameters of the optimization as a vector: log times, then angles [rad]."""
        return np.concatenate([np.log(self.duration), self.keys[1:-1, self.free].ravel()])

    def with_genes(self, genes: Array, robot: Robot) -> Keyframes:
        """Make the keyframes with other :attr:`genes`."""
        count = len(self.duration)
        keys = self.keys.copy()
        values = genes[count:].reshape(len(keys) - 2, len(self.free))
        keys[1:-1, self.free] = values
        paired, partner = self.free[self.mirrored], robot.mirror_index[self.free[self.mirrored]]
        keys[1:-1, partner] = values[:, self.mirrored] * robot.mirror_sign[paired]
        duration = np.exp(np.clip(genes[:count], math.log(0.08), math.log(2.0)))
        return replace(self, duration=duration, keys=np.clip(keys, robot.lower, robot.upper))
