"""Columns of what servos measure, for the tables of `getup servo list` and `monitor`."""

from __future__ import annotations

import math
from collections.abc import Mapping

from drivers.dynamixel.control_table import ControlTable
from drivers.state import HardwareError

HEADINGS = ("mode", "torque", "°", "°/s", "load", "V", "°C", "error")
LEFT = ("model", "mode", "torque", "error")
UNKNOWN = "-"


def list_cells(table: ControlTable | None, values: Mapping[str, int]) -> list[str]:
    """List the cells of a device from the counts of its registers; "-" for what it lacks."""
    if table is None:
        return [UNKNOWN] * len(HEADINGS)

    def write(register: str, form: str, factor: float = 1.0) -> str:
        if register not in values:
            return UNKNOWN
        return f"{table.to_si(register, values[register]) * factor + 0.0:{form}}"

    mode, torque = values.get("operating_mode"), values.get("torque_enable")
    error = HardwareError(table.name_errors(values.get("hardware_error_status", 0)))
    has_sensor = "present_current" in values  # of its current; the others estimate a load
    return [
        UNKNOWN if mode is None else table.name_mode(mode),
        {None: UNKNOWN, 0: "off"}.get(torque, "[bold red]on[/]"),
        write("present_position", "+.1f", math.degrees(1.0)),
        write("present_velocity", "+.0f", math.degrees(1.0)),
        f"{write('present_current', '.2f')} A" if has_sensor else write("present_load", ".0%"),
        write("present_input_voltage", ".1f"),
        write("present_temperature", ".0f"),
        f"[red]{error.describe()}[/]" if error else "",
    ]
