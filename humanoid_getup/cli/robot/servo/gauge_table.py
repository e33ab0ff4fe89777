"""Rows of a table of what servos measure."""

from __future__ import annotations

import math

from drivers.service.servos.gauges import Gauge
from drivers.state import HardwareError

HEADINGS = (
    "id",
    "model",
    "fw",
    "mode",
    "torque",
    "°",
    "seen °",
    "°/s",
    "load",
    "V",
    "°C",
    "remark",
)
LEFT = ("model", "mode", "torque", "remark")
UNKNOWN = "-"


def list_cells(gauge: Gauge) -> list[str]:
    """List the cells of a servo's row."""
    servo, values = gauge.servo, gauge.values
    return [
        str(servo.id),
        servo.table.model,
        str(servo.firmware),
        _name_mode(gauge),
        {None: UNKNOWN, 0: "off"}.get(values.get("torque_enable"), "[bold red]on[/]"),
        UNKNOWN if gauge.angle is None else f"{math.degrees(gauge.angle):+.1f}",
        _format_span(gauge),
        _format(gauge, "present_velocity", math.degrees(1.0), "+.0f"),
        _format_load(gauge),
        _format(gauge, "present_input_voltage", 1.0, ".1f"),
        _format(gauge, "present_temperature", 1.0, ".0f"),
        _remark(gauge),
    ]


def _name_mode(gauge: Gauge) -> str:
    """Name its operating mode; a servo without a register for it is in position mode or turns."""
    mode = gauge.values.get("operating_mode")
    return UNKNOWN if mode is None else gauge.servo.table.name_mode(mode)


def _format(gauge: Gauge, register: str, factor: float, form: str) -> str:
    value = gauge.to_si(register)
    return UNKNOWN if value is None else f"{value * factor + 0.0:{form}}"


def _format_span(gauge: Gauge) -> str:
    if gauge.lowest is None or gauge.highest is None:
        return UNKNOWN
    ends = [math.degrees(gauge.to_angle(ticks)) for ticks in (gauge.lowest, gauge.highest)]
    return f"{ends[0]:+.0f} to {ends[1]:+.0f}"


def _format_load(gauge: Gauge) -> str:
    """Write the current, or the load of a servo without a current sensor."""
    if (current := gauge.to_si("present_current")) is not None:
        return f"{current + 0.0:.2f} A"
    load = gauge.to_si("present_load")
    return UNKNOWN if load is None else f"{100.0 * load:.0f} %"


def _remark(gauge: Gauge) -> str:
    if gauge.missed:
        return "[yellow]silent[/]"
    error = HardwareError(gauge.errors)
    return f"[red]{error.describe()}[/]" if error else ""
