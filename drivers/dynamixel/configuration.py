"""Registers of a servo: what its goals hold, and what it needs before it may move."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from drivers.dynamixel.bus import TRIES, DynamixelBus
from drivers.dynamixel.control_table import (
    ControlTable,
    DriveMode,
    Item,
    OperatingMode,
    table_named,
)
from drivers.dynamixel.diagnostics import ServoFacts
from drivers.dynamixel.protocol2 import Span, Status
from robots import Robot
from robots.servo import MAX_TICKS, PWM_FULL_SCALE, LimitMode

SLOPES = ("cw_compliance_slope", "ccw_compliance_slope")
"""Items of a servo that has a compliance instead of a P gain."""
STIFFEST = 128  # a compliance slope is this divided by the gain, both powers of two
SOFTEST = 1  # gain of the softest slope

Counts = NDArray[np.int_]


def has_slope(table: ControlTable) -> bool:
    """Return whether a servo has a compliance slope instead of a P gain."""
    return SLOPES[0] in table


def goal_range(table: ControlTable) -> tuple[int, int]:
    """Return the goals that a servo takes [ticks]."""
    if table.counts_turns:
        return -MAX_TICKS, MAX_TICKS
    return 0, table["max_position_limit"].upper or 0


def full_scale(table: ControlTable) -> int:
    """Return the counts of the torque limit that are the whole supply."""
    return table["goal_pwm"].upper or PWM_FULL_SCALE if "goal_pwm" in table else PWM_FULL_SCALE


def round_gain(gain: Counts) -> Counts:
    """Round gains down to those that a compliance slope can make, but not below the softest."""
    powers = np.floor(np.log2(np.maximum(gain, SOFTEST)))
    return (2**powers).astype(int)


def to_slope(gain: Counts) -> Counts:
    """Convert gains to compliance slopes; that of gain 0 is the softest."""
    return STIFFEST // round_gain(gain)


class GoalScales:
    """Ranges and scales of the goals of a robot's servos, each of shape (n,)."""

    def __init__(self, robot: Robot) -> None:
        tables = [table_named(joint.servo.model.name) for joint in robot.joints]
        self.lowest, self.highest = np.array([goal_range(t) for t in tables]).T
        """Positions [ticks]."""
        self.full_scale = np.array([full_scale(table) for table in tables])
        """Counts of the torque limit that are the whole supply."""
        self.has_slope = np.array([has_slope(table) for table in tables])
        """Whether it has a compliance slope instead of a P gain."""


RECHECKED = ("return_delay_time", "drive_mode", "operating_mode")
"""EEPROM items that are read again when a servo may have restarted."""


WHOLE_TURN = {"multi_turn_offset": 0, "resolution_divider": 1, "angular_resolution": 1}
"""Items of some servos with which a turn has other counts, and their values as shipped."""
OPERATING_MODES: dict[LimitMode, OperatingMode] = {
    "current": OperatingMode.CURRENT_BASED_POSITION,
    "pwm": OperatingMode.EXTENDED_POSITION,
}
"""Operating mode for each way in which servos limit their torque."""


def list_eeprom_settings(servo: ServoFacts, limit_by: LimitMode) -> dict[str, int]:
    """List the EEPROM items that differ from what the driver needs, and the needed values.

    The servo accepts every tick of its turn, unless it keeps its limits: the guard limits the
    joint's range, and a joint that starts outside it must be held where it is.
    """
    table, registers = servo.table, servo.registers
    wanted = {
        "return_delay_time": 0,
        # Neither time-based profiles nor torque on by goal update; the direction is up to the
        # calibration.
        "drive_mode": registers.get("drive_mode", 0) & DriveMode.REVERSE,
        "operating_mode": _find_mode(servo, limit_by),
    }
    wanted |= WHOLE_TURN
    if table["status_return_level"].eeprom:
        wanted["status_return_level"] = table.all_answered
    if not servo.joint.servo.keeps_limits:
        last = table["max_position_limit"].upper or 0
        wanted |= {"max_position_limit": last, "min_position_limit": 0}
    return {name: value for name, value in wanted.items() if registers.get(name, value) != value}


def _find_mode(servo: ServoFacts, limit_by: LimitMode) -> int:
    """Return the operating mode of a servo: it keeps its limits in position mode alone."""
    if servo.table.mode_names and servo.table.default_mode is not None:
        return servo.table.default_mode
    mode = int(OPERATING_MODES[limit_by])
    keeps = servo.joint.servo.keeps_limits and mode == OperatingMode.EXTENDED_POSITION
    return int(OperatingMode.POSITION) if keeps else mode


def list_ram_settings(servo: ServoFacts, limit_by: LimitMode) -> dict[str, int]:
    """List the registers that power-up resets, to be set each time.

    The watchdog goes off here, tripped or not; it comes on with the torque.
    """
    table, p_gain = servo.table, servo.joint.servo.p_gain
    d_gain = table["position_d_gain"].default or 0 if "position_d_gain" in table else 0
    if limit_by == "current":  # whose loop takes the damping by back-EMF away
        d_gain = servo.joint.servo.model.d_gain
    slope = int(to_slope(np.array(p_gain))) if has_slope(table) else 0
    settings = {
        "status_return_level": table.all_answered,
        "bus_watchdog": 0,
        "position_d_gain": d_gain,
        "position_i_gain": 0,
        "position_p_gain": p_gain,
        "feedforward_2nd_gain": 0,
        "feedforward_1st_gain": 0,
        "profile_acceleration": 0,
        "profile_velocity": 0,
        **dict.fromkeys(SLOPES, slope),
        **table.prepared,
    }
    kept = ("status_return_level",) if table["status_return_level"].eeprom else ()
    return {name: n for name, n in settings.items() if name in table and name not in kept}


class ServoSetup:
    """Sets up one servo for torque, one instruction a step.

    Torque goes off first, for the EEPROM is locked under torque.
    """

    def __init__(self, servo: ServoFacts, limit_by: LimitMode, *, recheck: bool = False) -> None:
        """Prepare to set up a servo; ``recheck`` first whether it still is the same one."""
        self._servo = servo
        self._limit_by: LimitMode = limit_by
        self._must_check = recheck
        self.eeprom_writes = 0
        """Number of writes to the EEPROM, which wears out."""
        self.failed = ""
        """The instruction that the servo did not confirm; empty if nothing failed."""
        self._begin()

    @property
    def done(self) -> bool:
        """Return whether the servo is ready."""
        return not (self._left or self._must_check)

    def step(self, bus: DynamixelBus, tries: int = 1) -> bool:
        """Send the next instruction; return whether the servo confirmed it."""
        if self._must_check:
            return self._check(bus, tries)
        name, value = self._left[0]
        item = self._servo.table[name]
        if self._is_muted or name == "status_return_level":
            status = self._write_unconfirmed(bus, item, value, tries)
        else:
            status = bus.write(self._servo.id, item.address, item.encode(value), tries)
        if status is None or status.number:
            what = "silent" if status is None else f"error {status.number}"
            self.failed = f"{name} = {value} is not confirmed ({what})"
            return False
        self.eeprom_writes += item.eeprom and not self._is_locked
        if name == self._servo.table.keeps_by_lock:
            self._is_locked = bool(value)
        self.failed = ""
        self._left.pop(0)
        return True

    def run(self, bus: DynamixelBus) -> bool:
        """Take all steps; return whether the servo confirmed them all."""
        while not self.done:
            if not self.step(bus, TRIES):
                return False
        return True

    def _begin(self) -> None:
        lock = self._servo.table.keeps_by_lock
        kept = list(list_eeprom_settings(self._servo, self._limit_by).items())
        self._is_locked = False
        level = self._servo.table["status_return_level"]
        self._is_muted = self._servo.registers.get(level.name, level.upper) != level.upper
        self._left = [
            ("torque_enable", 0),
            *([(lock, 0)] if lock and kept else []),
            *kept,
            *([(lock, 1)] if lock else []),
            *list_ram_settings(self._servo, self._limit_by).items(),
        ]

    def _write_unconfirmed(
        self, bus: DynamixelBus, item: Item, value: int, tries: int
    ) -> Status | None:
        """Write to a servo that may not confirm it, and read it back then."""
        for _ in range(tries):
            status = bus.write(self._servo.id, item.address, item.encode(value))
            if status is not None or bus.read_item(self._servo.id, item, tries=1) == value:
                return status or Status(self._servo.id)
        return None

    def _check(self, bus: DynamixelBus, tries: int) -> bool:
        """Read the servo's model and EEPROM; refuse another model or firmware."""
        table = self._servo.table
        names = [n for n in ("model_number", "firmware_version", *RECHECKED) if n in table]
        first, last = min(table[n].address for n in names), max(table[n].end for n in names)
        status = bus.read(self._servo.id, Span(first, last - first), tries)
        if status is None or status.number:
            self.failed = "its model cannot be read"
            return False
        places = {n: slice(table[n].address - first, table[n].end - first) for n in names}
        values = {n: table[n].decode(status.data[place]) for n, place in places.items()}
        if (values["model_number"], values["firmware_version"]) != (
            table.number,
            self._servo.firmware,
        ):
            self.failed = (
                f"it is a model {values['model_number']} with firmware "
                f"{values['firmware_version']} now, not the {table.model} of the start"
            )
            return False
        again = {name: values[name] for name in RECHECKED if name in values}
        registers = {**self._servo.registers, **again}
        self._servo = replace(self._servo, registers=registers)
        self._must_check = False
        self._begin()
        return True
