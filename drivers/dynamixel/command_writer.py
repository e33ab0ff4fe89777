"""Converts commands to servo registers, and writes those that changed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drivers.dynamixel.bus import DynamixelBus
from drivers.dynamixel.configuration import (
    SLOPES,
    GoalScales,
    goal_range,
    has_slope,
    round_gain,
    to_slope,
)
from drivers.dynamixel.control_table import ControlTable, table_named
from drivers.dynamixel.protocol2 import Instruction, bulk_write
from drivers.dynamixel.requests import SyncWriter
from drivers.dynamixel.servo_states import ServoStates
from drivers.dynamixel.wire import Wire
from drivers.errors import SetupError
from drivers.servo_units import ServoUnits
from drivers.state import Command, Integers, check_command
from robots import Joint, Robot
from robots.quaternion import Array
from robots.servo import LimitMode, count_pwm

FAR = 100.0  # rad, beyond any servo; keeps absurd targets within whole numbers
MOST_CURRENT = 0xFFFF  # counts, more than any servo's limit
# Gains and limits are sent again every so many cycles, in case a servo has missed them.
REFRESH = 64
WRITTEN = (
    "torque_enable",
    "status_return_level",
    "position_p_gain",
    "bus_watchdog",
    "goal_pwm",
    "goal_position",
)
"""Registers that are written to all servos of a bus together."""
WRITTEN_BY_CURRENT = (*WRITTEN, "goal_current")
"""The same in current-based position mode."""


@dataclass(frozen=True, eq=False)
class RegisterCommands:
    """Register values to write to each servo, in joint order, each of shape (n,)."""

    goal: Integers
    """[ticks], with the whole turns that a register lacks."""
    p_gain: Integers
    """Register value."""
    pwm: Integers
    """Goal PWM [counts]."""
    current: Integers
    """Goal Current [counts]; used in current-based position mode only."""
    torque: NDArray[np.bool_]
    """Whether torque is on."""


class CommandConverter:
    """Converts commands to register values, and register values back to the command sent."""

    def __init__(self, robot: Robot, limit_by: LimitMode) -> None:
        self._robot = robot
        self._limit_by: LimitMode = limit_by
        self._units = ServoUnits(robot)
        self._scales = GoalScales(robot)
        self.pwm_limit = self._scales.full_scale.copy()
        """PWM Limit register of each servo [counts]."""
        self.current_limit = np.full(robot.n, MOST_CURRENT)
        """Current Limit register of each servo [counts]."""

    def note_limits(self, row: int, registers: Mapping[str, int]) -> None:
        """Note the limits that a servo's EEPROM puts on its goals."""
        self.pwm_limit[row] = registers["pwm_limit"]
        self.current_limit[row] = registers.get("current_limit", MOST_CURRENT)

    def to_registers(self, command: Command) -> RegisterCommands:
        """Convert a command; rounding never exceeds its limits.

        Raises:
            DriverError: if it has wrong shapes, negative limits, or NaN or inf.
        """
        robot = self._robot
        check_command(command, robot.joint_names)
        target = np.minimum(np.maximum(command.joint_pos, -FAR), FAR)
        goal = self._units.to_ticks(self._units.round_goal(target))
        torque = np.minimum(command.torque_limit, robot.max_torque)
        share, current = command.pwm_limit, self.current_limit
        if self._limit_by == "current":
            current = np.minimum(robot.count_current(torque), current)
        else:
            share = np.minimum(torque / robot.max_torque, share)
        scales = self._scales
        pwm = np.minimum(count_pwm(share, scales.full_scale), self.pwm_limit)
        scale = np.minimum(np.maximum(command.gain_scale, 0.0), 1.0)
        gain = np.rint(robot.p_gain * scale)
        # The softest slope still holds: without a gain such a servo has no torque.
        is_limp = scales.has_slope & (scale == 0.0)
        gain = np.where(scales.has_slope & ~is_limp, round_gain(gain), gain)
        return RegisterCommands(
            goal=np.clip(goal, scales.lowest, scales.highest),
            p_gain=gain.astype(int),
            pwm=pwm.astype(int),
            current=current.astype(int),
            torque=(pwm > 0) & (current > 0) & (torque > 0.0) & ~is_limp,
        )

    def to_command(self, registers: RegisterCommands, requested: Command) -> Command:
        """Convert register values to the command that they carry out."""
        robot, share = self._robot, registers.pwm / self._scales.full_scale
        torque: Array = share * robot.max_torque
        if self._limit_by == "current":
            torque = registers.current * robot.current_step * robot.torque_per_ampere
        limit = np.where(registers.torque, np.minimum(torque, requested.torque_limit), 0.0)
        return Command(
            joint_pos=self._units.to_rad(registers.goal),
            gain_scale=registers.p_gain / robot.p_gain,
            torque_limit=limit,
            pwm_limit=np.minimum(share, requested.pwm_limit),
        )


class LastWritten:
    """Last value written to one register of every servo.

    Only changes are sent, twice each in case a packet is lost.
    """

    def __init__(self, n: int) -> None:
        self._sent = np.full(n, -1)
        self._again = np.zeros(n, dtype=bool)

    def find_due(self, values: Integers) -> NDArray[np.bool_]:
        """Return which servos to write to; they count as written."""
        changed = values != self._sent
        due = changed | self._again
        self._again = changed
        self._sent = values
        return due

    def forget(self) -> None:
        """Forget what was written: a servo has restarted."""
        self._sent = np.full(len(self._sent), -1)


class CommandWriter:
    """Writes register commands to the servos of one bus, in an order that is safe.

    Torque goes off first. Where it comes on, gain and limit are set before, the goal is the
    present position, and the watchdog restarts. The goals of all servos come last, those
    without torque included: they end the cycle and feed the watchdogs. Servos without a watchdog
    may switch torque on when they get a goal: the limp ones get none, but torque off once more
    where all are limp.
    """

    def __init__(
        self,
        bus: DynamixelBus,
        joints: Sequence[Joint],
        rows: np.ndarray,
        watchdog: int,
        limit_by: LimitMode,
    ) -> None:
        """Prepare to write to joints, at places in the joint order; see `ServoChain`."""
        self._bus, self._rows, self._watchdog = bus, rows, watchdog
        self._ids = [joint.servo.id for joint in joints]
        tables = [table_named(joint.servo.model.name) for joint in joints]
        check_places(tables, limit_by)
        self._goal = tables[0]["goal_position"]
        self._feeds_limp = tables[0].has_watchdog
        is_by_current = limit_by == "current"
        names = WRITTEN_BY_CURRENT if is_by_current else WRITTEN
        self._writers = {
            name: _make_writer(name, self._ids, tables, bus.wire)
            for name in names
            if name in tables[0] or (name == "position_p_gain" and has_slope(tables[0]))
        }
        changing = ("position_p_gain", "goal_pwm", *(("goal_current",) if is_by_current else ()))
        self._last = {name: LastWritten(len(rows)) for name in changing}
        self._goal_range = goal_range(tables[0])
        self._all = np.ones(len(rows), dtype=bool)
        self._cycle = 0

    def write(
        self, commands: RegisterCommands, states: ServoStates, fresh: NDArray[np.bool_]
    ) -> None:
        """Write commands.

        Args:
            commands: For all joints of the robot; ``torque`` is what the states permit.
            states: States of the servos; torque that is switched is noted there.
            fresh: Joints whose position is new enough to begin from, shape (n,).
        """
        rows = self._rows
        self._cycle += 1
        wanted = commands.torque[rows]
        was_on = states.is_on[rows]
        off = ~wanted & (was_on | states.must_release[rows])
        if off.any():
            self._write_some("torque_enable", off, 0)
            states.note_off(rows[off])
        on = wanted & fresh[rows] & (~was_on | states.must_seed[rows])
        switches_on = bool(on.any())
        values = {
            "position_p_gain": commands.p_gain[rows],
            "goal_pwm": commands.pwm[rows],
            "goal_current": commands.current[rows],
        }
        for i, (name, last) in enumerate(self._last.items()):
            due = last.find_due(values[name])
            if self._cycle % REFRESH == i * REFRESH // len(self._last):
                due = self._all
            if switches_on:
                due = due | on  # a servo may have lost what was written before
            if due.any():
                self._write_some(name, due, values[name])
        if switches_on:
            self._switch_on(on, states)
        goals = commands.goal[rows] - states.turns[rows]
        if self._feeds_limp:
            present = np.clip(states.register[rows], *self._goal_range)
            self.write_all("goal_position", np.where(states.is_on[rows], goals, present))
        elif states.is_on[rows].any():
            self._write_some("goal_position", states.is_on[rows], goals)
        elif not off.all():
            self.write_all("torque_enable", 0)

    def forget(self) -> None:
        """Write all gains and limits again: a servo has been set up."""
        for last in self._last.values():
            last.forget()

    def write_all(self, name: str, values: Integers | int) -> None:
        """Write one of the `WRITTEN` registers of all servos: one value each, or one for all.

        One that the servos do not have is not written.
        """
        self._send(name, values, None)

    def _write_some(self, name: str, chosen: NDArray[np.bool_], values: Integers | int) -> None:
        self._send(name, values, chosen)

    def _send(self, name: str, values: Integers | int, chosen: NDArray[np.bool_] | None) -> None:
        if name in self._writers:
            self._bus.send(self._writers[name].encode(values, chosen))

    def _switch_on(self, on: NDArray[np.bool_], states: ServoStates) -> None:
        chosen = self._rows[on]
        # A watchdog that has tripped locks the goals until it is cleared.
        self._write_some("bus_watchdog", on, 0)
        ids = (self._ids[i] for i in np.flatnonzero(on))
        present = np.clip(states.register[chosen], *self._goal_range)
        seeds = {i: self._goal.encode(int(ticks)) for i, ticks in zip(ids, present, strict=True)}
        self._seed(seeds)
        self._write_some("bus_watchdog", on, self._watchdog)
        self._write_some("torque_enable", on, 1)
        states.note_on(chosen)

    def _seed(self, goals: Mapping[int, bytes]) -> None:
        """Set the goals of servos without torque, by id.

        Not by a sync write: on a virtual bus in lock-step that would end the cycle.
        """
        address = self._goal.address
        if Instruction.BULK_WRITE in self._bus.wire.instructions:
            packet = bulk_write({i: (address, goal) for i, goal in goals.items()})
            self._bus.send(packet.encode())
            return
        for device, goal in goals.items():
            self._bus.write(device, address, goal)


class SlopeWriter(SyncWriter):
    """Writes gains to servos that have a compliance slope for each direction instead."""

    def encode(
        self, values: NDArray[np.int_] | int, chosen: NDArray[np.bool_] | None = None
    ) -> bytes:
        """Build the frame that sets the gains of all devices, or of some, by mask (n,)."""
        slope = to_slope(np.asarray(values))
        return super().encode(slope | slope << 8, chosen)


def _make_writer(name: str, ids: list[int], tables: list[ControlTable], wire: Wire) -> SyncWriter:
    if name == "position_p_gain" and has_slope(tables[0]):
        return SlopeWriter(tables[0][SLOPES[0]].address, "<u2", ids, wire)
    item = tables[0][name]
    return SyncWriter(item.address, item.kind, ids, wire)


def check_places(tables: Sequence[ControlTable], limit_by: LimitMode) -> None:
    """Check that servos on one port can be written to together; raise `SetupError` else."""
    models = ", ".join(sorted({table.model for table in tables}))
    names = WRITTEN_BY_CURRENT if limit_by == "current" else WRITTEN
    for name in (*names, *SLOPES):
        items = {table[name].span if name in table else None for table in tables}
        if len(items) > 1:
            raise SetupError(f"servos {models} keep {name} in different places: give each a port")
    if lacking := [table.model for table in tables if "goal_pwm" not in table]:
        raise SetupError(
            f"servo {lacking[0]} has no register that limits its torque: it is not moved here, "
            "expected servos that have one"
        )
