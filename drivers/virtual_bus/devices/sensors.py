"""The measured registers of a servo: position, velocity, load, supply, moving flags.

The horn turns endlessly in its own direction; the position register counts in the direction of the
drive mode, from the homing offset and from the turn to which it was last reset.
"""

from __future__ import annotations

import math
import struct
from typing import NamedTuple

from drivers.dynamixel.control_table import DriveMode, OperatingMode
from drivers.twin.device_models import AMBIENT_TEMPERATURE
from drivers.virtual_bus.devices.profile import PositionControl
from drivers.virtual_bus.devices.registers import MAX_COUNTS, Registers, clamp
from robots.servo import PWM_FULL_SCALE, TICKS_PER_TURN

MAX_HOMING_IN_ONE_TURN = 1024  # ticks; larger offsets are ignored in mode 3 (e-manual)
# ticks, at which Moving Status reports arrival and a following error; no figures published
IN_POSITION, FOLLOWING_ERROR = 20, 100
NOMINAL_VOLTAGE = 12.0  # V, or the middle of the model's range
_SIDE_BY_SIDE = struct.Struct("<hhii")  # PWM, load, velocity, position: so in every servo's table


class Measured(NamedTuple):
    """Physical quantities of a servo, in the horn's own direction."""

    ticks: float = 0.5 * TICKS_PER_TURN
    """Position of the horn, turns included."""
    velocity: float = 0.0
    """[rad/s]"""
    current: float = 0.0
    """[A]"""
    pwm_share: float = 0.0
    """Share of the supply on the motor, -1 to 1."""
    voltage: float = NOMINAL_VOLTAGE
    """Supply [V]."""
    temperature: float = AMBIENT_TEMPERATURE
    """[°C]"""


class Sensors:
    """Converts physical quantities to the present-value and moving registers of a servo."""

    def __init__(self, registers: Registers, control: PositionControl) -> None:
        self._registers, self._control = registers, control
        table = registers.table
        self._has_current = "present_current" in table
        self._load_scale = table["present_current" if self._has_current else "present_load"].scale
        self._speed_scale = table["present_velocity"].scale
        self._at_flags = table["moving"].address
        self._at_pwm = table["present_pwm"].address
        self._at_supply = table["present_input_voltage"].address
        middle = 0.05 * (registers["min_voltage_limit"] + registers["max_voltage_limit"])
        self.measured = Measured(voltage=min(NOMINAL_VOLTAGE, middle))
        self.sign = 1.0
        """-1 when the drive mode reverses the servo."""
        self.offset = 0.0
        """Register value minus signed horn position [ticks]."""
        self._turns = 0.0  # ticks that bring the position into one turn
        self._speed_counts = self._position_counts = 0
        self.fold()

    @property
    def position(self) -> int:
        """Return the value of the position register [ticks]."""
        return round(self.sign * self.measured.ticks + self.offset)

    def to_horn(self, position: float) -> float:
        """Convert a register position [ticks] to the horn's own."""
        return self.sign * (position - self.offset)

    def update(self, measured: Measured) -> None:
        """Set the measured quantities."""
        self.measured = measured
        self._write()

    def fold(self) -> None:
        """Bring the position back into one turn."""
        self.reload()
        turn = math.floor(self.sign * self.measured.ticks / TICKS_PER_TURN)
        self._turns = -float(turn * TICKS_PER_TURN)
        self.reload()

    def reload(self) -> None:
        """Reload the configuration from the registers."""
        registers = self._registers
        self._mode = registers["operating_mode"]
        # Reversed, ticks count down; the homing offset keeps its sign (e-manual).
        self.sign = -1.0 if registers["drive_mode"] & DriveMode.REVERSE else 1.0
        homing = registers["homing_offset"]
        if self._mode == OperatingMode.POSITION and abs(homing) > MAX_HOMING_IN_ONE_TURN:
            homing = 0
        self.offset = self._turns + homing
        self._threshold = registers["moving_threshold"]
        self._write()

    def _write(self) -> None:
        sign, memory, measured = self.sign, self._registers.memory, self.measured
        share = sign * measured.pwm_share
        load = sign * measured.current if self._has_current else share
        speed = self._speed_counts = clamp(
            round(sign * measured.velocity / self._speed_scale), MAX_COUNTS
        )
        position = self._position_counts = clamp(self.position, MAX_COUNTS)
        _SIDE_BY_SIDE.pack_into(
            memory,
            self._at_pwm,
            clamp(round(share * PWM_FULL_SCALE), PWM_FULL_SCALE),
            clamp(round(load / self._load_scale), 0x7FFF),
            speed,
            position,
        )
        at, volts = self._at_supply, min(max(round(measured.voltage * 10.0), 0), 0xFFFF)
        memory[at], memory[at + 1] = volts & 0xFF, volts >> 8
        memory[at + 2] = min(max(round(measured.temperature), 0), 0xFF)
        self.write_flags()

    def write_flags(self) -> None:
        """Update Moving and Moving Status (e-manual)."""
        control, position = self._control, self._position_counts
        running = control.running
        status = running << 1 | control.shape << 4
        has_arrived = abs(self._registers["goal_position"] - position) <= IN_POSITION
        is_off_path = abs(control.position - position) > FOLLOWING_ERROR
        status |= has_arrived | (is_off_path and self._registers["torque_enable"]) << 3
        memory, at = self._registers.memory, self._at_flags
        memory[at] = running or abs(self._speed_counts) > self._threshold
        memory[at + 1] = status
