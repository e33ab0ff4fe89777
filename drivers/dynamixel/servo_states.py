"""What the driver knows of each servo: its newest values and where it stands."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from drivers.dynamixel.bus import Replies
from drivers.dynamixel.control_table import table_named
from drivers.dynamixel.diagnostics import ServoFacts
from drivers.dynamixel.protocol2 import ALERT
from robots import Robot
from robots.servo import RAD_PER_TICK

# Offsets in the group read: current (or load), velocity, position.
CURRENT, VELOCITY, POSITION = 0, 2, 6
GROUP_BYTES = 10
LEAP = 30  # ticks that a position may jump at any time: noise, and the clock's jitter
FASTEST = 20.0 / RAD_PER_TICK  # ticks/s; four times the no-load speed of the servos known here
MISSED = 2.5  # periods of silence in which a servo may have restarted


class ServoStates:
    """Arrays over all joints, in the robot's joint order; lines fill them, the backend reads.

    The flags tell how far a servo may be trusted. Torque comes on only where ``is_ready``
    and not ``is_locked``.
    """

    def __init__(self, robot: Robot, period: float) -> None:
        n = robot.n
        self._period = period
        joints = robot.joints
        self._row = np.full(256, -1)
        self._row[[joint.servo.id for joint in joints]] = np.arange(n)
        self._sign = np.array([float(joint.servo.sign) for joint in joints])
        scales = [
            _scales(joint.servo.model.name, joint.servo.model.stall_current) for joint in joints
        ]
        self._velocity_scale = self._sign * np.array([velocity for velocity, _ in scales])
        self._current_scale = self._sign * np.array([current for _, current in scales])
        self.ticks = np.zeros(n, dtype=int)
        """Present positions [ticks]; no measurement before ``stamp`` is finite."""
        self._claimed = np.zeros(n, dtype=int)
        self.velocity = np.zeros(n)
        """[rad/s]"""
        self.current = np.zeros(n)
        """[A]"""
        self.stamp = np.full(n, -np.inf)
        """When position, velocity and current were measured [s]."""
        self.temperature = np.zeros(n)
        """[°C]"""
        self.voltage = np.zeros(n)
        """[V]"""
        self.alert = np.zeros(n, dtype=int)
        """Hardware error bits; ``ALERT`` while they have not been read."""
        self.is_on = np.zeros(n, dtype=bool)
        """Torque was switched on, as far as the driver knows."""
        self.is_ready = np.zeros(n, dtype=bool)
        """Its registers are as they have to be."""
        self.is_locked = np.zeros(n, dtype=bool)
        """Its port was lost under torque: a command has to release it before the next torque."""
        self.is_unsure = np.zeros(n, dtype=bool)
        """Its torque register is to be read at once."""
        self.doubts = np.zeros(n, dtype=int)
        """How often in a row it told torque off where torque is on."""
        self.must_release = np.zeros(n, dtype=bool)
        """It has torque where it should not."""
        self.must_seed = np.zeros(n, dtype=bool)
        """Its goal is to begin anew at its present position, and its watchdog too."""

    def row(self, device: int) -> int:
        """Return the joint of an id."""
        return int(self._row[device])

    def adopt(self, servos: Iterable[ServoFacts]) -> None:
        """Take over what an audit has read."""
        for servo in servos:
            row = self.row(servo.id)
            self.voltage[row], self.temperature[row] = servo.voltage, servo.temperature

    def take(self, answers: Replies, now: float) -> None:
        """Take over what a group told at a time [s].

        A position further away than any joint can have gone is not believed until the next
        one confirms it: a 16-bit CRC lets one damaged answer in 65536 through.
        """
        rows, ticks = self._row[answers.devices], answers.column(POSITION, "<i4")
        leaps = np.abs(ticks - self.ticks[rows]) > LEAP + FASTEST * (now - self.stamp[rows])
        if leaps.any():
            is_told_again = np.abs(ticks - self._claimed[rows]) <= LEAP + FASTEST * self._period
            self._claimed[rows[leaps]] = ticks[leaps]
            believed = ~leaps | is_told_again
            answers, rows, ticks = answers.choose(believed), rows[believed], ticks[believed]
        self.is_unsure[rows] |= self.is_on[rows] & (now - self.stamp[rows] > MISSED * self._period)
        self.current[rows] = self._current_scale[rows] * answers.column(CURRENT, "<i2")
        self.velocity[rows] = self._velocity_scale[rows] * answers.column(VELOCITY, "<i4")
        self.ticks[rows] = ticks
        self.stamp[rows] = now
        alerted = (answers.errors & ALERT).astype(int)
        if alerted.any() or self.alert.any():
            known = self.alert[rows]
            self.alert[rows] = np.where(alerted, np.where(known, known, ALERT), 0)

    def take_torque(self, row: int, told: int) -> None:
        """Compare a servo's torque register with what it should be."""
        self.is_unsure[row] = False
        if told and not self.is_on[row]:
            self.must_release[row] = True
        if told or not self.is_on[row]:
            self.doubts[row] = 0
            return
        self.doubts[row] += 1
        if self.doubts[row] == 1:
            self.is_unsure[row] = True  # one answer is not enough to call it a restart
        else:
            self.note_restart(row)

    def note_restart(self, row: int) -> None:
        """Note that a servo may have forgotten its registers."""
        self.is_on[row] = self.is_ready[row] = self.is_unsure[row] = False
        self.doubts[row] = 0

    def note_lost_port(self, rows: np.ndarray) -> None:
        """Note that servos' port is gone: nobody knows how they are until they are set up again."""
        self.is_locked[rows] |= self.is_on[rows]
        self.is_on[rows] = self.is_ready[rows] = self.is_unsure[rows] = False
        self.must_release[rows] = True

    def note_ready(self, row: int) -> None:
        """Note that a servo is set up, without torque."""
        self.is_ready[row] = True
        self.is_on[row] = self.must_release[row] = self.must_seed[row] = False


def _scales(model: str, stall_current: float) -> tuple[float, float]:
    """Return what a count of velocity [rad/s] and of current [A] is worth."""
    table = table_named(model)
    velocity = table["present_velocity"].scale
    if "present_current" in table:
        return velocity, table["present_current"].scale
    # A servo without a current sensor tells its load as a share of the drive.
    return velocity, table["present_load"].scale * stall_current
