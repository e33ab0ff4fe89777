"""A virtual OpenCR board: IMU, battery voltage, and the servos' power switch."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from drivers.dynamixel.control_table import table_named
from drivers.virtual_bus.devices.device import VirtualDevice
from drivers.virtual_bus.devices.maintenance import reset_ram
from drivers.virtual_bus.devices.quirks import Quirks

AXES = ("x", "y", "z")


class VirtualBoard(VirtualDevice):
    """Replies like an OpenCR; writing its power register calls ``on_power``."""

    def __init__(
        self,
        board_id: int = 200,
        *,
        firmware: int = 1,
        baud: int = 2_000_000,
        on_power: Callable[[bool], None] | None = None,
        quirks: Quirks | None = None,
    ) -> None:
        """Build a board with the servos' power off; ``baud`` is in bit/s."""
        super().__init__(table_named("OpenCR"), board_id, firmware, baud, quirks or Quirks())
        self.frozen = False
        """True while the IMU repeats its last values."""
        self.on_power = on_power
        self._effects["dynamixel_power"] = self._switch_power

    def sense_imu(self, gyro_counts: Sequence[int], acc_counts: Sequence[int]) -> None:
        """Set the IMU registers, in counts along the board's own axes, (3,) each."""
        if self.frozen:
            return
        for name, counts in (("gyro", gyro_counts), ("acc", acc_counts)):
            for axis, count in zip(AXES, counts, strict=True):
                self.registers[f"{name}_{axis}"] = max(-32768, min(32767, int(count)))

    def sense_voltage(self, voltage: float) -> None:
        """Set the measured battery voltage [V]."""
        self.registers["present_input_voltage"] = max(0, min(255, round(voltage * 10.0)))

    def _boot(self) -> None:
        super()._boot()
        self._reset_ram()

    def _lose_power(self) -> None:
        super()._lose_power()
        self._reset_ram()

    def _reset_ram(self) -> None:
        reset_ram(self.registers)
        self._switch_power(0)

    def _switch_power(self, value: int) -> None:
        if self.on_power is not None:
            self.on_power(bool(value))
