"""The kinds of faults that a schedule may name: what each needs, does and ends with."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from drivers.control_table import HardwareError
from drivers.virtual.faults import Faults
from drivers.virtual.line_faults import LineFault


@dataclass(frozen=True, kw_only=True)
class ScheduledFault:
    """One entry: what happens when; fields that its kind does not have are None."""

    at: float
    """Bus time [s]."""
    kind: str
    duration: float | None = None
    """Time after which it ends again [s]; None for never."""
    device: int | None = None
    """Id; None for the whole bus."""
    rate: float | None = None
    """Share of answers, requests or bytes, 0 to 1."""
    count: int | None = None
    """Number of answers or requests."""
    seconds: float | None = None
    """How long an answer is kept back [s]."""
    error: str | None = None
    """Name of a hardware error, in lower case."""
    temperature: float | None = None
    """[°C]"""
    voltage: float | None = None
    """[V]"""


@dataclass(frozen=True)
class Kind:
    """What a kind of fault needs, and does."""

    start: Callable[[Faults, Any], None]
    end: Callable[[Faults, Any], None] | None = None
    """None where nothing ends."""
    needs: tuple[str, ...] = ()
    takes: tuple[str, ...] = ()


def _disturb_line(faults: Faults, fault: ScheduledFault) -> None:
    kind = LineFault(fault.kind)
    if kind is LineFault.LATE:
        faults.set_times(late_by=fault.seconds)
    if kind is LineFault.SPLIT:
        faults.set_times(split_pause=fault.seconds)
    if fault.rate is None:
        faults.order(kind, fault.device, fault.count or 1)
    else:
        faults.set_rate(kind, fault.rate)


def _calm_line(faults: Faults, fault: ScheduledFault) -> None:
    if fault.rate is not None:
        faults.set_rate(LineFault(fault.kind), 0.0)


def _line_kind(fault: LineFault) -> Kind:
    takes = ("rate", "count", "for")
    if fault not in (LineFault.LOSE_REQUEST, LineFault.FLIP_REQUEST, LineFault.ECHO):
        takes += ("id",)
    if fault in (LineFault.LATE, LineFault.SPLIT):
        takes += ("seconds",)
    return Kind(_disturb_line, _calm_line, takes=takes)


KINDS: Mapping[str, Kind] = {fault.value: _line_kind(fault) for fault in LineFault} | {
    "kill": Kind(
        lambda faults, fault: faults.kill(fault.device),
        lambda faults, fault: faults.revive(fault.device),
        needs=("id",),
        takes=("for",),
    ),
    "revive": Kind(lambda faults, fault: faults.revive(fault.device), needs=("id",)),
    "reboot": Kind(lambda faults, fault: faults.reboot(fault.device), needs=("id",)),
    "trip": Kind(
        lambda faults, fault: faults.trip(fault.device, HardwareError[fault.error.upper()]),
        needs=("id", "error"),
    ),
    "heat": Kind(
        lambda faults, fault: faults.heat(fault.device, fault.temperature),
        needs=("id", "temperature"),
    ),
    "sag": Kind(lambda faults, fault: faults.sag(fault.voltage), needs=("voltage",)),
    "freeze_imu": Kind(
        lambda faults, _: faults.freeze_imu(),
        lambda faults, _: faults.freeze_imu(False),
        takes=("for",),
    ),
    "silence": Kind(
        lambda faults, _: faults.silence(),
        lambda faults, _: faults.silence(False),
        takes=("for",),
    ),
    "unplug": Kind(
        lambda faults, _: faults.unplug(), lambda faults, _: faults.replug(), takes=("for",)
    ),
    "replug": Kind(lambda faults, _: faults.replug()),
}
"""Kinds of faults by their names in a file."""
