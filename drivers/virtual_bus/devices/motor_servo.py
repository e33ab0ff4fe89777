"""What all virtual servos share: a motor that physics simulates, and the servo's own clock."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass

from drivers.dynamixel.control_table import table_named
from drivers.dynamixel.protocol2 import ErrorNumber
from drivers.state import HardwareError
from drivers.virtual_bus.devices.device import Quirks, VirtualDevice
from drivers.virtual_bus.devices.sensors import Measured
from robots.description.servo_catalog import servo_models

# Of the stall current, that a servo sustains, and s of the overload model: the manual mentions a
# persistent load above the maximum output. At full stall a cold servo trips after about that time.
OVERLOAD_SHARE, OVERLOAD_TIME = 0.8, 3.0


@dataclass(frozen=True, slots=True)
class MotorCommand:
    """Command to the motor, in the horn's own direction."""

    torque_on: bool = False
    by_current: bool = False
    """Whether the current limits the torque: in current-based position mode."""
    target_ticks: float = 0.0
    """Target of the position loop, turns included, without homing offset."""
    p_gain: int = 0
    """Register value of the position loop's gain, as is the next."""
    d_gain: int = 0
    pwm_limit: float = 0.0
    """Largest share of the supply, 0 to 1."""
    current_limit: float = 0.0
    """[A]; infinite for a model without current limit."""


class MotorServo(VirtualDevice, ABC):
    """A servo of any kind; physics reads `motor_command` and calls `sense`."""

    passing = HardwareError.VOLTAGE  # though the manual names a reboot alone
    """Errors that go with their cause."""

    usual: tuple[str, int, int]
    """Type, firmware and baud rate [bit/s] where none are given."""

    def __init__(
        self,
        servo_id: int,
        model: str | None = None,
        *,
        firmware: int | None = None,
        baud: int | None = None,
        quirks: Quirks | None = None,
        stall_current: float | None = None,
    ) -> None:
        """Build a servo of a type at factory defaults, its horn in the middle of its positions."""
        model = model or self.usual[0]
        firmware = self.usual[1] if firmware is None else firmware
        self._figures, table = servo_models()[model], table_named(model, firmware)
        super().__init__(table, servo_id, firmware, baud or self.usual[2], quirks or Quirks())
        self._stall_current = stall_current or self._figures.stall_current
        self._heat = 0.0  # of the winding, as a share of that at stall
        self._at_tick = table["realtime_tick"].address if "realtime_tick" in table else None
        self._boot_start, self._is_shut_down = 0.0, False
        self._motor_command: MotorCommand | None = None
        self._connect()
        self._restart()

    def motor_command(self) -> MotorCommand:
        """Return the present command to the motor."""
        if self._motor_command is None:
            self._motor_command = self._compute_motor_command()
        return self._motor_command

    def advance(self, now: float) -> None:
        """Advance to a bus time [s]: its clock, what it does, and overload."""
        duration, self.now = now - self.now, now
        if not self._powered or now < self._booted_at:
            return
        if self._at_tick is not None:
            tick = int((now - self._boot_start) * 1000.0)
            memory, at = self.registers.memory, self._at_tick
            memory[at], memory[at + 1] = tick & 0xFF, tick >> 8 & 0x7F  # wraps after 32767
        current = self._run(duration)
        if self._heat or current:
            # At first order the heat follows (current / stall)².
            share = current / self._stall_current
            self._heat += (share * share - self._heat) * -math.expm1(-duration / OVERLOAD_TIME)
            if self._heat > OVERLOAD_SHARE**2:
                self.trip(HardwareError.OVERLOAD)

    def reboot(self) -> None:
        """Restart with RAM at its defaults."""
        self._boot()

    def trip(self, error: HardwareError) -> None:
        """Set a hardware error; if the shutdown register has it, torque goes off."""
        self._set_alarms(self.alarms | error)
        if error & self.table.name_errors(self.registers["shutdown"]):
            self._is_shut_down = True
            self._release()

    def _protect(self, measured: Measured) -> None:
        """Trip at a new error; those that pass go with their cause."""
        bits, (lowest, highest, hottest) = 0, self._limits
        if not lowest <= round(measured.voltage * 10.0) <= highest:
            bits = HardwareError.VOLTAGE.value
        if measured.temperature > hottest:
            bits |= HardwareError.OVERHEATING.value
        if new := bits & ~self.alarms:
            self.trip(HardwareError(new))
        self._set_alarms(self.alarms & (bits | ~self.passing))

    def _reload_limits(self) -> None:
        """Reload the limits of supply and temperature from the registers."""
        names = ("min_voltage_limit", "max_voltage_limit", "temperature_limit")
        self._limits = [self.registers[name] for name in names]

    def _set_alarms(self, alarms: int) -> None:
        if alarms == self.alarms:
            return
        self.alarms = int(alarms)
        if "hardware_error_status" in self.registers:
            known = self.table.error_bits
            shown = sum(1 << i for i, bit in enumerate(known) if bit & alarms)
            self.registers["hardware_error_status"] = shown if known else self.alarms

    def _handle_reboot(self, _params: bytes) -> int:
        self.reboot()
        return ErrorNumber.NONE

    def _boot(self) -> None:
        super()._boot()
        self._boot_start = max(self._booted_at, self.now)
        self._restart()

    def _lose_power(self) -> None:
        super()._lose_power()
        self._release()

    # For subclasses ----------------------------------------------------------------------

    @abstractmethod
    def _connect(self) -> None:
        """Add what its registers do, when it is built."""

    @abstractmethod
    def _release(self) -> None:
        """Switch its torque off."""

    @abstractmethod
    def _compute_motor_command(self) -> MotorCommand:
        """Compute the command to the motor from the registers."""

    @abstractmethod
    def _run(self, duration: float) -> float:
        """Do for some time [s] what the registers say; return the measured current [A]."""

    @abstractmethod
    def _restart(self) -> None:
        """Set RAM to its power-up values."""
