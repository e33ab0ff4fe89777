"""Servo states: the newest values of every servo, and its state as known to the driver."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from drivers.dynamixel.control_table import table_named
from drivers.dynamixel.diagnostics import ServoFacts
from drivers.dynamixel.protocol2 import ALERT
from drivers.dynamixel.requests import GroupLayout, Replies
from drivers.dynamixel.whole_turns import WholeTurns
from drivers.state import Integers
from robots import Robot

TORQUE, WATCHDOG, SUPPLY = "torque_enable", "bus_watchdog", "present_input_voltage"
ERROR = "hardware_error_status"
"""Items of the background read; that of the supply ends with the temperature."""
TRIPPED = 0xFF  # Bus Watchdog register: -1, the servo has stopped by itself
LEAP = 30  # ticks that a position may jump at any time: noise, and the clock's jitter
FASTEST = 20.0  # rad/s, or four times the no-load speed of a servo where that is more
EDGE = 0.1  # of a turn, that a joint may move while its servo starts
MISSED = 2.5  # periods of silence in which a servo may have restarted


class ServoStates:
    """Arrays over all joints, in the robot's joint order; only its methods write them.

    The flags tell how far a servo may be trusted. Torque comes on only where ``is_ready``
    and not ``is_locked``.
    """

    def __init__(self, robot: Robot, period: float) -> None:
        n = robot.n
        self._period = period
        self._tables = [table_named(joint.servo.model.name) for joint in robot.joints]
        self._layouts = [GroupLayout.of(table) for table in self._tables]
        self._row = np.full(256, -1)
        self._row[[joint.servo.id for joint in robot.joints]] = np.arange(n)
        sign = np.array([float(joint.servo.sign) for joint in robot.joints])
        velocity = [table["present_velocity"].scale for table in self._tables]
        self._velocity_scale = sign * robot.transmission.motion_at_actuator(np.array(velocity))
        self._current_scale = sign * _current_scales(robot)
        speed = [4.0 * joint.servo.model.no_load_speed for joint in robot.joints]
        tick = np.array([joint.servo.model.rad_per_tick for joint in robot.joints])
        self._fastest = np.maximum(FASTEST, speed) / tick  # ticks/s, (n,)
        self._whole_turns = WholeTurns(robot)
        self._half_turn = np.array([joint.servo.model.ticks_per_turn for joint in robot.joints]) / 2
        self.register = np.zeros(n, dtype=int)
        """Position registers [ticks]; not measured before ``stamp`` is finite."""
        self.turns = np.zeros(n, dtype=int)
        """Whole turns that the registers lack [ticks]."""
        self._doubtful = np.zeros(n, dtype=int)  # registers
        self.velocity = np.zeros(n)
        """Of the servos behind their gears [rad/s]."""
        self.current = np.zeros(n)
        """[A]"""
        self.stamp = np.full(n, -np.inf)
        """Time of the measurement of position, velocity and current [s]."""
        self.temperature = np.zeros(n)
        """[°C]"""
        self.voltage = np.zeros(n)
        """[V]"""
        self.alert = np.zeros(n, dtype=int)
        """Hardware error bits; ``ALERT`` while they have not been read."""
        self.is_on = np.zeros(n, dtype=bool)
        """Torque was switched on, as far as the driver knows."""
        self.may_drive = np.zeros(n, dtype=bool)
        """Torque was switched on, and was not confirmed off at a `close` since."""
        self.is_ready = np.zeros(n, dtype=bool)
        """All registers are set."""
        self.is_locked = np.zeros(n, dtype=bool)
        """The port was lost under torque: a command has to release it before the next torque."""
        self.is_unsure = np.zeros(n, dtype=bool)
        """The torque register is to be read next."""
        self.must_release = np.zeros(n, dtype=bool)
        """It has torque where it should not."""
        self.must_seed = np.zeros(n, dtype=bool)
        """The goal is to restart at the present position, with the watchdog."""
        self._off_reads = np.zeros(n, dtype=int)  # in a row, where torque should be on

    @property
    def ticks(self) -> Integers:
        """Return the present positions [ticks], (n,)."""
        return self.register + self.turns

    def row(self, device: int) -> int:
        """Return the joint of an id."""
        return int(self._row[device])

    # Measurements -----------------------------------------------------------------------------

    def update_from_facts(self, servos: Iterable[ServoFacts]) -> None:
        """Take over position, supply and temperature from the diagnostics at startup."""
        for servo in servos:
            row = self.row(servo.id)
            self.voltage[row], self.temperature[row] = servo.voltage, servo.temperature
            self.register[row] = servo.registers["present_position"]
        self.turns = self._whole_turns.resolve(self.register, self.register) - self.register

    def update_cyclic(self, replies: Replies, now: float) -> None:
        """Take over position, velocity and current, read at a time [s].

        A position further away than any joint can have moved is accepted only once the next
        read confirms it: a 16-bit CRC lets one damaged reply in 65536 through.
        """
        rows = self._row[replies.devices]
        layout = self._layouts[rows[0]]  # that of all servos on its port
        register = layout.decode(layout.position, replies)
        leaps = np.abs(register - self.register[rows]) > LEAP + self._fastest[rows] * (
            now - self.stamp[rows]
        )
        if leaps.any():
            reach = LEAP + self._fastest[rows] * self._period
            is_confirmed = np.abs(register - self._doubtful[rows]) <= reach
            self._doubtful[rows[leaps]] = register[leaps]
            accepted = ~leaps | is_confirmed
            replies, rows, register = replies.select(accepted), rows[accepted], register[accepted]
        self.is_unsure[rows] |= self.is_on[rows] & (now - self.stamp[rows] > MISSED * self._period)
        load, velocity = (layout.decode(i, replies) for i in (layout.load, layout.velocity))
        self.current[rows] = self._current_scale[rows] * load
        self.velocity[rows] = self._velocity_scale[rows] * velocity
        self._take_over(rows, register)
        self.stamp[rows] = now
        alerted = (replies.errors & ALERT).astype(int)
        if alerted.any() or self.alert.any():
            known = self.alert[rows]
            self.alert[rows] = np.where(alerted, np.where(known, known, ALERT), 0)

    def _take_over(self, rows: Integers, register: Integers) -> None:
        """Take over position registers, and find the whole turns of servos that lost theirs.

        Their registers leap by half a turn or more into the first turn, from beyond it or near its
        ends: within it a start changes nothing, and a leap is a joint that was turned by hand.
        """
        turn, before = 2 * self._half_turn[rows], self.ticks
        old, margin = self.register[rows], EDGE * turn
        leaps = np.abs(register - old) > self._half_turn[rows]
        leaps &= (old < margin) | (old >= turn - margin) | ~np.isfinite(self.stamp[rows])
        leaps &= (register >= 0) & (register < turn)
        self.register[rows] = register
        if leaps.any():
            found = self._whole_turns.resolve(self.register, before, rows[leaps])
            lost = rows[leaps]
            self.turns[lost] = found[lost] - self.register[lost]

    def update_background(self, row: int, item: str, data: bytes) -> None:
        """Take over the registers of one item of the background read."""
        if item == TORQUE:
            self._compare_torque(row, has_torque=bool(data[0]))
        elif item == WATCHDOG:
            self.must_seed[row] |= data[0] == TRIPPED and bool(self.is_on[row])
        elif item == ERROR:
            self.note_errors(row, self._tables[row].name_errors(data[0]))
        else:
            voltage = self._tables[row][SUPPLY]
            self.voltage[row] = voltage.to_si(voltage.decode(data[: voltage.size]))
            self.temperature[row] = data[voltage.size]

    def note_errors(self, row: int, bits: int) -> None:
        """Note the hardware errors of a servo that reports an alert, or did until just now."""
        self.alert[row] = bits or (self.alert[row] and ALERT)

    def update_torque(self, replies: Replies, *, is_final: bool) -> bool:
        """Compare torque registers with what was written; return whether all agree.

        Where torque is off by mistake it is switched on again, unless the read is the final
        one: then the servo may have restarted.
        """
        rows, has_torque = self._row[replies.devices], replies.data[:, 0] == 1
        self.must_release[rows[has_torque & ~self.is_on[rows]]] = True
        off = rows[~has_torque & self.is_on[rows]]
        (self.is_unsure if is_final else self.must_seed)[off] = True
        return np.array_equal(has_torque, self.is_on[rows])

    def _compare_torque(self, row: int, *, has_torque: bool) -> None:
        self.is_unsure[row] = False
        if has_torque and not self.is_on[row]:
            self.must_release[row] = True
        if has_torque or not self.is_on[row]:
            self._off_reads[row] = 0
            return
        self._off_reads[row] += 1
        if self._off_reads[row] == 1:
            self.is_unsure[row] = True  # one reply is not enough to call it a restart
        else:
            self.note_restart(row)

    # Commands ---------------------------------------------------------------------------------

    def permit_torque(
        self, requested: NDArray[np.bool_], fresh: NDArray[np.bool_], *, was_paused: bool
    ) -> NDArray[np.bool_]:
        """Return which of the requested joints may have torque, (n,).

        Args:
            requested: Joints that a command gives torque, (n,); the others are unlocked.
            fresh: Joints whose position is new enough to begin from, (n,).
            was_paused: Whether the watchdogs may have tripped since the last command.
        """
        self.is_locked &= requested
        if was_paused:
            self.must_seed |= self.is_on
        return requested & self.is_ready & ~self.is_locked & (self.is_on | fresh)

    def note_on(self, rows: NDArray[np.int_]) -> None:
        """Note that torque was switched on at the present position."""
        self.is_on[rows] = self.may_drive[rows] = True
        self.must_seed[rows] = self.must_release[rows] = False
        self._off_reads[rows] = 0

    def note_off(self, rows: NDArray[np.int_]) -> None:
        """Note that torque was switched off."""
        self.is_on[rows] = self.must_release[rows] = self.must_seed[rows] = False

    # Events -----------------------------------------------------------------------------------

    def note_restart(self, row: int) -> None:
        """Note that a servo may have lost its registers."""
        self.is_on[row] = self.is_ready[row] = self.is_unsure[row] = False
        self._off_reads[row] = 0

    def note_lost_port(self, rows: NDArray[np.int_]) -> None:
        """Note that the port of some servos is gone: their state is unknown until set up again."""
        self.is_locked[rows] |= self.is_on[rows]
        self.is_on[rows] = self.is_ready[rows] = self.is_unsure[rows] = False
        self.must_release[rows] = True

    def note_ready(self, row: int) -> None:
        """Note that a servo is set up, without torque."""
        self.is_ready[row] = True
        self.is_on[row] = self.must_release[row] = self.must_seed[row] = False

    def note_rebooted(self, row: int, *, has_alert: bool) -> None:
        """Note that a servo was rebooted and set up, and whether it still reports an alert."""
        self.note_ready(row)
        self.alert[row] = ALERT if has_alert else 0


def _current_scales(robot: Robot) -> NDArray[np.float64]:
    """Return the current of one count of each servo [A], (n,)."""
    scales = []
    for joint in robot.joints:
        table = table_named(joint.servo.model.name)
        layout = GroupLayout.of(table)
        # A servo without a current sensor reports its load as a share of the stall current.
        most = 1.0 if layout.measures_current else joint.servo.model.stall_current
        scales.append(layout.load.scale * most)
    return np.array(scales)
