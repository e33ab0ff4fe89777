"""What all virtual servos share: a motor that physics simulates, and the servo's own clock."""

from __future__ import annotations

from abc import ABC, abstractmethod

from drivers.dynamixel.control_table import ControlTable
from drivers.state import HardwareError
from drivers.virtual_bus.devices.device import VirtualDevice
from drivers.virtual_bus.devices.motor_command import MotorCommand
from drivers.virtual_bus.devices.protection import Protection
from drivers.virtual_bus.devices.quirks import Quirks
from robots.servo import ServoModel


class MotorServo(VirtualDevice, ABC):
    """A servo of any kind; physics reads `motor_command` and calls `sense`."""

    def __init__(
        self,
        table: ControlTable,
        servo_id: int,
        firmware: int,
        baud: int,
        quirks: Quirks,
        figures: ServoModel,
        stall_current: float | None,
    ) -> None:
        """Build a servo of a type; the stall current [A] is that of its type if None is given."""
        super().__init__(table, servo_id, firmware, baud, quirks)
        stall = figures.stall_current if stall_current is None else stall_current
        self._protection = Protection(self.registers, quirks, stall)
        self._at_tick = table["realtime_tick"].address if "realtime_tick" in table else None
        self._boot_start = 0.0
        self.late = 0.0
        """Time by which its physics, and so its own clock, is behind that of the bus [s]."""
        self._motor_command: MotorCommand | None = None

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
            tick = int((now - self._boot_start - self.late) * 1000.0)
            memory, at = self.registers.memory, self._at_tick
            memory[at], memory[at + 1] = tick & 0xFF, tick >> 8 & 0x7F  # wraps after 32767
        self._run(duration)
        if self._protection.overload.advance(self._motor_current, duration):
            self.trip(HardwareError.OVERLOAD)

    def _boot(self) -> None:
        super()._boot()
        self._boot_start = max(self._booted_at, self.now)
        self._restart()

    # For subclasses ----------------------------------------------------------------------

    @abstractmethod
    def trip(self, error: HardwareError) -> None:
        """Set a hardware error; if the shutdown register has it, torque goes off."""

    @property
    @abstractmethod
    def _motor_current(self) -> float:
        """Return the measured current [A]."""

    @abstractmethod
    def _compute_motor_command(self) -> MotorCommand:
        """Compute the command to the motor from the registers."""

    @abstractmethod
    def _run(self, duration: float) -> None:
        """Do for some time [s] what the registers say."""

    @abstractmethod
    def _restart(self) -> None:
        """Set RAM to its power-up values."""
