"""Schedules of faults: reads them from a TOML file and injects them at their times."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Literal

from msgspec import Meta

from drivers.errors import SetupError
from drivers.state import HardwareError
from drivers.virtual_bus.serving.fault_injector import FaultInjector, LineFault
from robots.storage.validation import load_toml, read_table, reading, shown, whole

LONGEST_TIME = 1e6  # s


def within(lower: float, upper: float, unit: str = "") -> Meta:
    """Limit a number to [lower, upper]."""
    expected = f"a number from {lower:g} to {upper:g} {unit}".rstrip()
    return Meta(ge=lower, le=upper, description=expected)


Time = Annotated[float, within(0.0, LONGEST_TIME, "s")]


@dataclass(frozen=True, kw_only=True)
class ScheduledFault:
    """One entry of a schedule; fields that its kind does not have are None."""

    at: Time
    """Bus time [s]."""
    kind: str
    duration: Time | None = field(default=None, metadata={"key": "for"})
    """Duration [s]; None for no end."""
    id: Annotated[int, whole(0, 252)] | None = None
    """Device; None for the whole bus."""
    rate: Annotated[float, within(0.0, 1.0)] | None = None
    """Share of replies, requests or bytes."""
    count: Annotated[int, whole(1, 10**9)] | None = None
    """Number of replies or requests."""
    seconds: Annotated[float, within(0.0, 10.0, "s")] | None = None
    """How long a reply is held back."""
    error: Literal["voltage", "overheating", "encoder", "shock", "overload"] | None = None
    """Name of a hardware error."""
    temperature: Annotated[float, within(-40.0, 200.0, "°C")] | None = None
    voltage: Annotated[float, within(0.0, 30.0, "V")] | None = None


Action = Callable[[FaultInjector], None]
Act = Callable[[ScheduledFault, FaultInjector], None]


@dataclass(frozen=True, kw_only=True)
class InjectableFault:
    """A kind of fault: its actions, and its fields besides ``at`` and ``kind``."""

    start: Act
    end: Act | None = None
    """None if the fault has no end."""
    needs: tuple[str, ...] = ()
    takes: tuple[str, ...] = ()


def _start_line_fault(fault: ScheduledFault, faults: FaultInjector) -> None:
    kind = LineFault(fault.kind)
    if kind is LineFault.LATE and fault.seconds is not None:
        faults.line.late_by = fault.seconds
    if kind is LineFault.SPLIT and fault.seconds is not None:
        faults.line.split_pause = fault.seconds
    if fault.rate is None:
        faults.strike_next(kind, fault.id, fault.count or 1)
    else:
        faults.set_rate(kind, fault.rate)


def _line_kind(fault: LineFault) -> InjectableFault:
    def end(scheduled: ScheduledFault, faults: FaultInjector) -> None:
        if scheduled.rate is not None:
            faults.set_rate(fault, 0.0)

    takes = ("rate", "count", "for")
    if fault not in (LineFault.LOSE_REQUEST, LineFault.FLIP_REQUEST, LineFault.ECHO):
        takes += ("id",)
    if fault in (LineFault.LATE, LineFault.SPLIT):
        takes += ("seconds",)
    return InjectableFault(start=_start_line_fault, end=end, takes=takes)


def _kind(
    start: Callable[..., None], *needs: str, end: Callable[..., None] | None = None
) -> InjectableFault:
    """Describe a fault by functions of the injector and the values of the fields it needs."""

    def act(function: Callable[..., None], fault: ScheduledFault, faults: FaultInjector) -> None:
        function(faults, *(getattr(fault, name) for name in needs))

    return InjectableFault(
        start=partial(act, start),
        end=partial(act, end) if end else None,
        needs=needs,
        takes=("for",) if end else (),
    )


def _trip(faults: FaultInjector, device: int, error: str) -> None:
    faults.trip(device, HardwareError[error.upper()])


KINDS: Mapping[str, InjectableFault] = {fault.value: _line_kind(fault) for fault in LineFault} | {
    "kill": _kind(FaultInjector.kill, "id", end=FaultInjector.revive),
    "revive": _kind(FaultInjector.revive, "id"),
    "reboot": _kind(FaultInjector.reboot, "id"),
    "trip": _kind(_trip, "id", "error"),
    "heat": _kind(FaultInjector.heat, "id", "temperature"),
    "sag": _kind(FaultInjector.sag, "voltage"),
    "freeze_imu": _kind(
        FaultInjector.freeze_imu, end=partial(FaultInjector.freeze_imu, frozen=False)
    ),
    "silence": _kind(FaultInjector.silence, end=partial(FaultInjector.silence, silent=False)),
    "unplug": _kind(FaultInjector.unplug, end=FaultInjector.replug),
    "replug": _kind(FaultInjector.replug),
}
"""Kinds of faults by their name in a file."""


@dataclass(frozen=True)
class FaultSchedule:
    """Faults in the order of their times."""

    faults: tuple[ScheduledFault, ...] = ()

    @classmethod
    def from_file(cls, file: Path | str, devices: Collection[int] = ()) -> FaultSchedule:
        """Read the ``[[fault]]`` tables of a TOML file, which may name these devices, if any."""
        file = Path(file)
        with reading(str(file), SetupError) as problems:
            table = load_toml(file)
            unknown = table.keys() - {"fault"}
            problems += [f"unknown table {shown(key)}, expected fault" for key in unknown]
            entries = table.get("fault", [])
            if not isinstance(entries, list):
                problems.append(f"fault is {shown(entries)}, expected [[fault]] tables")
                entries = []
            faults = [
                _read_entry(entry, f"fault {i}: ", devices, problems)
                for i, entry in enumerate(entries, start=1)
            ]
        return cls(tuple(sorted((f for f in faults if f), key=lambda fault: fault.at)))

    def plan_actions(self) -> list[tuple[float, Action]]:
        """Return bus times [s] and actions in order, the ends of faults included."""
        actions: list[tuple[float, Action]] = []
        for fault in self.faults:
            kind = KINDS[fault.kind]
            actions.append((fault.at, partial(kind.start, fault)))
            if kind.end and fault.duration is not None:
                actions.append((fault.at + fault.duration, partial(kind.end, fault)))
        return sorted(actions, key=lambda action: action[0])


def _read_entry(
    entry: Any, owner: str, devices: Collection[int], problems: list[str]
) -> ScheduledFault | None:
    """Read one entry; None if its kind is unknown."""
    if not isinstance(entry, dict):
        problems.append(f"{owner}is {shown(entry)}, expected a table")
        return None
    name = entry.get("kind")
    if not isinstance(name, str) or name not in KINDS:
        state = f"is {shown(name)}" if "kind" in entry else "is missing"
        problems.append(f"{owner}kind {state}, expected {', '.join(KINDS)}")
        return None
    kind, owner = KINDS[name], f"{owner}{name}: "
    known = ("kind", "at", *kind.needs, *kind.takes)
    problems += [
        f"{owner}unknown field {shown(key)}, expected {', '.join(known)}"
        for key in entry
        if key not in known
    ]
    fault = read_table(ScheduledFault, entry, owner, problems, required=kind.needs)
    if devices and fault.id is not None and fault.id >= 0 and fault.id not in devices:
        expected = ", ".join(map(str, sorted(devices)))
        problems.append(f"{owner}id is {fault.id}, expected {expected}")
    if "rate" in entry and ("count" in entry or "id" in entry):
        problems.append(f"{owner}has a rate and also a count or an id, expected only one of them")
    if "for" in entry and "rate" in kind.takes and "rate" not in entry:
        problems.append(f"{owner}has a duration without a rate, expected both")
    return fault
