"""A virtual board, of the OpenCR's make: IMU, battery voltage, the servos' power switch."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from drivers.dynamixel.control_table import ControlTable, table_named
from drivers.errors import SetupError
from drivers.imu.fusion import ACCELEROMETER_STEP, GYRO_STEP
from drivers.virtual_bus.devices.device import Quirks, VirtualDevice
from robots.bus_settings import BoardSettings
from robots.imu import SensorAxes
from robots.quaternion import Array

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
        settings: BoardSettings | None = None,
    ) -> None:
        """Build a board with the servos' power off.

        Its rate is in bit/s. The settings say how its IMU is turned, and where the registers of
        a board without a known model are.
        """
        settings = settings or BoardSettings(model="OpenCR", id=board_id, imu_axes=(1, 1, 1))
        is_known = bool(settings.model)
        table = table_named("OpenCR") if is_known else make_board_table(settings)
        super().__init__(table, board_id, firmware, baud, quirks or Quirks())
        self._axes = SensorAxes.of(settings.imu_axes)
        self._gyro_step = GYRO_STEP if is_known else settings.gyro_scale
        self._acc_step = ACCELEROMETER_STEP if is_known else settings.accelerometer_scale
        self.frozen = False
        """True while the IMU repeats its last values."""
        self.on_power = on_power
        self._effects["dynamixel_power"] = self._switch_power

    def sense_body(self, gyro: Array, accelerometer: Array) -> None:
        """Set the IMU registers from rates [rad/s] and forces [m/s²] in the site's axes, (3,)."""
        self.sense_imu(
            _to_counts(self._axes.to_sensor(gyro), self._gyro_step),
            _to_counts(self._axes.to_sensor(accelerometer), self._acc_step),
        )

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
        self.registers.reset_ram()
        self._switch_power(0)

    def _switch_power(self, value: int) -> None:
        if self.on_power is not None:
            self.on_power(bool(value))


def _to_counts(values: Array, step: float) -> list[int]:
    return np.rint(values / step).astype(int).tolist()


def make_board_table(settings: BoardSettings) -> ControlTable:
    """Make the control table of a board that is known by the addresses of its IMU alone."""
    known = table_named("OpenCR")
    items = {item.name: item for item in known if item.eeprom}
    end = max(item.end for item in items.values())
    lowest = min(settings.gyro_address, settings.accelerometer_address)
    if lowest < end:
        raise SetupError(
            f"a virtual board has registers of its own up to {end - 1}, expected the IMU's behind "
            f"them, found {lowest}"
        )
    for sensor, first in (("gyro", settings.gyro_address), ("acc", settings.accelerometer_address)):
        for place, axis in enumerate(AXES):
            name = f"{sensor}_{axis}"
            items[name] = replace(known[name], address=first + 2 * place)
    end = max(item.end for item in items.values())
    for name in ("present_input_voltage", "dynamixel_power"):  # as far as it has them
        items[name] = replace(known[name], address=end)
        end += 1
    return replace(known, model="board", number=0, items=items)
