"""Schedules of faults: reads them from a TOML file and injects them at their times."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from drivers.dynamixel.control_table import HardwareError
from drivers.errors import SetupError
from drivers.virtual_bus.serving.fault_injector import FaultInjector
from drivers.virtual_bus.serving.wire_faults import LineFault
from robots.validation import is_number, shown


@dataclass(frozen=True, kw_only=True)
class ScheduledFault:
    """One entry of a schedule; fields that its kind does not have are None."""

    at: float
    """Bus time [s]."""
    kind: str
    duration: float | None = None
    """Duration [s]; None for no end."""
    device: int | None = None
    """Id; None for the whole bus."""
    rate: float | None = None
    """Share of replies, requests or bytes, 0 to 1."""
    count: int | None = None
    """Number of replies or requests."""
    seconds: float | None = None
    """How long a reply is held back [s]."""
    error: str | None = None
    """Name of a hardware error, in lower case."""
    temperature: float | None = None
    """[°C]"""
    voltage: float | None = None
    """[V]"""


@dataclass(frozen=True)
class FaultKind:
    """Fields and actions of one kind of fault."""

    start: Callable[[FaultInjector, Any], None]
    end: Callable[[FaultInjector, Any], None] | None = None
    """None if the fault has no end."""
    needs: tuple[str, ...] = ()
    takes: tuple[str, ...] = ()


def _start_line_fault(faults: FaultInjector, fault: ScheduledFault) -> None:
    kind = LineFault(fault.kind)
    if kind is LineFault.LATE:
        faults.set_times(late_by=fault.seconds)
    if kind is LineFault.SPLIT:
        faults.set_times(split_pause=fault.seconds)
    if fault.rate is None:
        faults.order(kind, fault.device, fault.count or 1)
    else:
        faults.set_rate(kind, fault.rate)


def _end_line_fault(faults: FaultInjector, fault: ScheduledFault) -> None:
    if fault.rate is not None:
        faults.set_rate(LineFault(fault.kind), 0.0)


def _line_kind(fault: LineFault) -> FaultKind:
    takes = ("rate", "count", "for")
    if fault not in (LineFault.LOSE_REQUEST, LineFault.FLIP_REQUEST, LineFault.ECHO):
        takes += ("id",)
    if fault in (LineFault.LATE, LineFault.SPLIT):
        takes += ("seconds",)
    return FaultKind(_start_line_fault, _end_line_fault, takes=takes)


KINDS: Mapping[str, FaultKind] = {fault.value: _line_kind(fault) for fault in LineFault} | {
    "kill": FaultKind(
        lambda faults, fault: faults.kill(fault.device),
        lambda faults, fault: faults.revive(fault.device),
        needs=("id",),
        takes=("for",),
    ),
    "revive": FaultKind(lambda faults, fault: faults.revive(fault.device), needs=("id",)),
    "reboot": FaultKind(lambda faults, fault: faults.reboot(fault.device), needs=("id",)),
    "trip": FaultKind(
        lambda faults, fault: faults.trip(fault.device, HardwareError[fault.error.upper()]),
        needs=("id", "error"),
    ),
    "heat": FaultKind(
        lambda faults, fault: faults.heat(fault.device, fault.temperature),
        needs=("id", "temperature"),
    ),
    "sag": FaultKind(lambda faults, fault: faults.sag(fault.voltage), needs=("voltage",)),
    "freeze_imu": FaultKind(
        lambda faults, _: faults.freeze_imu(),
        lambda faults, _: faults.freeze_imu(False),
        takes=("for",),
    ),
    "silence": FaultKind(
        lambda faults, _: faults.silence(),
        lambda faults, _: faults.silence(False),
        takes=("for",),
    ),
    "unplug": FaultKind(
        lambda faults, _: faults.unplug(), lambda faults, _: faults.replug(), takes=("for",)
    ),
    "replug": FaultKind(lambda faults, _: faults.replug()),
}
"""Kinds of faults by their name in a file."""

Action = Callable[[FaultInjector], None]


class FaultScheduleError(SetupError):
    """A schedule file is invalid."""

    def __init__(self, file: Path, faults: list[str]) -> None:
        super().__init__(f"{file}: {'; '.join(faults)}")
        self.file, self.faults = file, faults


@dataclass(frozen=True)
class FaultSchedule:
    """FaultInjector in the order of their times."""

    faults: tuple[ScheduledFault, ...] = ()

    @classmethod
    def from_file(cls, file: Path | str, devices: Collection[int] = ()) -> FaultSchedule:
        """Read a schedule.

        Args:
            file: TOML file with one ``[[fault]]`` table per entry.
            devices: Ids on the bus that the file may name; empty for no check.

        Raises:
            FaultScheduleError: listing all problems of the file.
        """
        file = Path(file)
        table = _read_table(file)
        faults: list[str] = []
        entries = table.get("fault", [])
        for key in table.keys() - {"fault"}:
            faults.append(f"unknown table {shown(key)}, expected fault")
        if not isinstance(entries, list):
            raise FaultScheduleError(
                file, [*faults, f"fault is {shown(entries)}, expected [[fault]] tables"]
            )
        read = [
            _read_entry(entry, f"fault {i}: ", devices, faults)
            for i, entry in enumerate(entries, start=1)
        ]
        if faults:
            raise FaultScheduleError(file, faults)
        return cls(tuple(sorted((f for f in read if f), key=lambda fault: fault.at)))

    def plan_actions(self) -> list[tuple[float, Action]]:
        """Return bus times [s] and actions in order, the ends of faults included."""
        actions: list[tuple[float, Action]] = []
        for fault in self.faults:
            kind = KINDS[fault.kind]
            actions.append((fault.at, _bind(kind.start, fault)))
            if kind.end and fault.duration is not None:
                actions.append((fault.at + fault.duration, _bind(kind.end, fault)))
        return sorted(actions, key=lambda action: action[0])


@dataclass(frozen=True)
class NumberRange:
    """Expected range of a number in a file."""

    lower: float
    upper: float
    unit: str = ""
    whole: bool = False

    def holds(self, value: object) -> bool:
        """Return whether a value is in the range."""
        if not is_number(value) or (self.whole and not isinstance(value, int)):
            return False
        return self.lower <= value <= self.upper

    def __str__(self) -> str:
        kind = "an integer" if self.whole else "a number"
        return f"{kind} from {self.lower:g} to {self.upper:g} {self.unit}".rstrip()


_LONGEST = 1e6  # s
RANGES: Mapping[str, NumberRange] = {
    "at": NumberRange(0.0, _LONGEST, "s"),
    "for": NumberRange(0.0, _LONGEST, "s"),
    "id": NumberRange(0, 252, whole=True),
    "rate": NumberRange(0.0, 1.0),
    "count": NumberRange(1, 10**9, whole=True),
    "seconds": NumberRange(0.0, 10.0, "s"),
    "temperature": NumberRange(-40.0, 200.0, "°C"),
    "voltage": NumberRange(0.0, 30.0, "V"),
}
"""Ranges of numbers by their name in a file."""
ERRORS = tuple(str(error.name).lower() for error in HardwareError)
_ATTRIBUTES = {"for": "duration", "id": "device"}


def _read_table(file: Path) -> dict[str, Any]:
    try:
        return tomllib.loads(file.read_text("utf-8"))
    except OSError as error:
        raise FaultScheduleError(file, [str(error.strerror)]) from error
    except (ValueError, RecursionError) as error:
        raise FaultScheduleError(file, [f"not TOML ({' '.join(str(error).split())})"]) from error


def _read_entry(
    entry: Any, owner: str, devices: Collection[int], faults: list[str]
) -> ScheduledFault | None:
    """Read one entry; on problems, add them to ``faults`` and return None."""
    if not isinstance(entry, dict):
        faults.append(f"{owner}is {shown(entry)}, expected a table")
        return None
    name = entry.get("kind")
    if not isinstance(name, str) or name not in KINDS:
        state = f"is {shown(name)}" if "kind" in entry else "is missing"
        faults.append(f"{owner}kind {state}, expected {', '.join(KINDS)}")
        return None
    kind, owner = KINDS[name], f"{owner}{name}: "
    found = list(_find_entry_faults(entry, kind, devices))
    faults.extend(owner + fault for fault in found)
    if found:
        return None
    content = {_ATTRIBUTES.get(str(key), str(key)): value for key, value in entry.items()}
    return ScheduledFault(**content)


def _find_entry_faults(entry: dict[str, Any], kind: FaultKind, devices: Collection[int]):
    needs = ("at", *kind.needs)
    known = ("kind", *needs, *kind.takes)
    for key in needs:
        if key not in entry:
            yield f"{key} is missing, expected {RANGES.get(key) or ', '.join(ERRORS)}"
    for key, value in entry.items():
        if key not in known:
            yield f"unknown field {shown(key)}, expected {', '.join(known)}"
        elif key == "error" and value not in ERRORS:
            yield f"error is {shown(value)}, expected {', '.join(ERRORS)}"
        elif key in RANGES and not RANGES[key].holds(value):
            yield f"{key} is {shown(value)}, expected {RANGES[key]}"
        elif key == "id" and devices and value not in devices:
            yield f"id is {value}, expected {', '.join(map(str, sorted(devices)))}"
    if "rate" in entry and ("count" in entry or "id" in entry):
        yield "has a rate and also a count or an id, expected only one of them"
    if "for" in entry and "rate" in kind.takes and "rate" not in entry:
        yield "has a duration without a rate, expected both"


def _bind(act: Callable[[FaultInjector, Any], None], fault: ScheduledFault) -> Action:
    return lambda faults: act(faults, fault)
