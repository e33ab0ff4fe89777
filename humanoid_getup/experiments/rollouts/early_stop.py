"""Early stops: end a simulated rollout as soon as its outcome is known."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from humanoid_getup.experiments.judging.record import Record
from humanoid_getup.experiments.judging.standing import HOLD_TIME
from humanoid_getup.experiments.judging.torque import LONG_SATURATION, count_runs, find_saturation
from robots import Robot
from robots.quaternion import Array

CHUNK = 25  # control periods between two checks
HELD = HOLD_TIME + 0.3  # s; a stand that lasts this long counts as held
REST_TIME = 0.6  # s; a robot that has stood at rest this long stays there
REST_SPEED = 0.03  # rad/s and m/s; bound for every degree of freedom at rest
LATEST_STAND = 1.5  # s after the last target within which a stand must begin
DOWN_NECK, DOWN_TILT = 0.6, math.radians(60.0)  # bounds beyond which a robot is down
DOWN_TIME = 0.2  # s after the last target; a robot that is down then has fallen


class EarlyStop:
    """Decides for each of N robots whether its rollout is over.

    A robot at rest in a stand, with constant targets, will stay there, so its hold need not be
    simulated. A robot that lies after its last target has fallen. One whose servo has been
    saturated for too long fails, because the overload protection of the servo may trip.
    """

    def __init__(self, robot: Robot, length: NDArray[np.int_], voltage: Array) -> None:
        """Begin rollouts of motions with ``length`` samples, (N,), at a supply [V], (N,)."""
        self._robot, self._length, self._voltage = robot, length, voltage
        count = len(length)
        self.cycle = 0
        """Samples so far."""
        self.going = np.ones(count, dtype=bool)
        """Whether each rollout continues, (N,)."""
        self.failed, self.stood = np.zeros(count, dtype=bool), np.zeros(count, dtype=bool)
        self.cycles = np.zeros(count, dtype=int)
        """Number of samples until each was stopped, (N,)."""
        self._since = np.zeros(count, dtype=int)
        self._saturated = np.zeros((count, robot.n), dtype=int)

    def cut(self, target: Array) -> Array:
        """Return the next chunk of a robot's targets (T, n); the last is repeated."""
        return target[np.minimum(self.cycle + np.arange(CHUNK), len(target) - 1)]

    def add(self, going: NDArray[np.int_], record: Record, speed: Array) -> None:
        """Read a chunk of the continuing robots, and decide which rollouts are over.

        The speed of each is the greatest of any degree of freedom [rad/s, m/s].
        """
        broken = ~record.upright
        after = self.cycle + CHUNK - np.argmax(broken[:, ::-1], axis=1)  # the last break
        since = np.where(broken.any(axis=1), after, self._since[going])
        self.cycle += CHUNK
        self.cycles[going], self._since[going] = self.cycle, since
        held = (self.cycle - since) * record.period
        past = (self.cycle - self._length[going]) * record.period  # s after the last target
        settled = (speed < REST_SPEED) & (np.minimum(held, past) >= REST_TIME)
        overloaded = self._find_overloaded(going, record)
        stood = (past > 0.0) & ((held >= HELD) | settled) & ~overloaded
        neck = record.stance.neck_height[:, -1] / self._robot.standing_neck_height
        down = (neck < DOWN_NECK) | (record.stance.tilt[:, -1] > DOWN_TILT)
        late = (since - self._length[going]) * record.period > LATEST_STAND
        hopeless = (down & (past > DOWN_TIME)) | late | record.diverged | overloaded
        self.stood[going], self.failed[going] = stood, ~stood & hopeless
        self.going[going] = ~(stood | hopeless)

    def _find_overloaded(self, going: NDArray[np.int_], record: Record) -> NDArray[np.bool_]:
        """Find the robots with a servo whose overload protection may have tripped by now."""
        saturated = find_saturation(
            self._robot, record.torque, record.actuator_vel, self._voltage[going, np.newaxis]
        )
        runs = count_runs(saturated, self._saturated[going])
        self._saturated[going] = runs[:, -1]
        return runs.max(axis=(1, 2)) * record.period > LONG_SATURATION
