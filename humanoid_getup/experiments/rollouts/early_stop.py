"""Early stops: when it is known of a robot in simulation whether it stands up."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from humanoid_getup.experiments.judging.record import Record
from humanoid_getup.experiments.judging.standing import HOLD_TIME
from humanoid_getup.experiments.judging.torque import LONG_SATURATION, count_runs, find_saturation
from robots import Robot
from robots.quaternion import Array

CHUNK = 25  # control periods between two looks at the robots
HELD = HOLD_TIME + 0.3  # s of stand that is a held one
REST_TIME = 0.6  # s of stand at rest after which nothing can change any more
REST_SPEED = 0.03  # rad/s and m/s, of every degree of freedom at rest
LAST_CALL = 1.5  # s after the last target within which a stand must begin
DOWN_NECK, DOWN_TILT = 0.6, math.radians(60.0)  # of a robot that fell
DOWN_TIME = 0.2  # s after the last target from which such a robot will not rise any more


class EarlyStop:
    """Decides which of N robots are over.

    A robot that is at rest in a stand, with targets that do not move any more, stays there: its
    hold need not be simulated. One that lies after its last target has fallen, and one whose
    servos had no reserve of torque for long fails as its overload protection may trip.
    """

    def __init__(self, robot: Robot, length: NDArray[np.int_], voltage: Array) -> None:
        """Begin with motions of ``length`` samples, (N,), at a supply [V], (N,)."""
        self._robot, self._length, self._voltage = robot, length, voltage
        count = len(length)
        self.cycle = 0
        """Samples so far."""
        self.going = np.ones(count, dtype=bool)
        """Which robots go on, (N,)."""
        self.failed, self.stood = np.zeros(count, dtype=bool), np.zeros(count, dtype=bool)
        self.cycles = np.zeros(count, dtype=int)
        """Samples until each was stopped, (N,)."""
        self._since = np.zeros(count, dtype=int)
        self._saturated = np.zeros((count, robot.n), dtype=int)

    def add(self, going: NDArray[np.int_], record: Record, speed: Array) -> None:
        """Read a chunk of the robots that go on, and decide which of them are over.

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
        late = (since - self._length[going]) * record.period > LAST_CALL
        hopeless = (down & (past > DOWN_TIME)) | late | record.diverged | overloaded
        self.stood[going], self.failed[going] = stood, ~stood & hopeless
        self.going[going] = ~(stood | hopeless)

    def _find_overloaded(self, going: NDArray[np.int_], record: Record) -> NDArray[np.bool_]:
        """Find the robots of which a servo's overload protection may have tripped by now."""
        saturated = find_saturation(
            self._robot, record.torque, record.actuator_vel, self._voltage[going, np.newaxis]
        )
        runs = count_runs(saturated, self._saturated[going])
        self._saturated[going] = runs[:, -1]
        return runs.max(axis=(1, 2)) * record.period > LONG_SATURATION
