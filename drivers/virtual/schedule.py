"""A file of faults, each with its time.

[[fault]]
at = 1.2          # bus time [s]
kind = "kill"
id = 13
for = 0.5         # s, then the cable is mended
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from drivers.control_table import HardwareError
from drivers.errors import SetupError
from drivers.virtual.fault_kinds import KINDS, Kind, ScheduledFault
from drivers.virtual.faults import Faults
from robots.faults import is_number, shown

Action = Callable[[Faults], None]


class ScheduleError(SetupError):
    """A schedule of faults that cannot be used."""

    def __init__(self, file: Path, faults: list[str]) -> None:
        super().__init__(f"{file}: {'; '.join(faults)}")
        self.file, self.faults = file, faults


@dataclass(frozen=True)
class Schedule:
    """Faults in the order of their times."""

    faults: tuple[ScheduledFault, ...] = ()

    @classmethod
    def from_file(cls, file: Path | str, devices: Collection[int] = ()) -> Schedule:
        """Read a schedule.

        Args:
            file: TOML file with one ``[[fault]]`` table an entry.
            devices: Ids on the bus, to check the file's against; none for no check.

        Raises:
            ScheduleError: telling all that is wrong at once.
        """
        file = Path(file)
        table = _read_table(file)
        faults: list[str] = []
        entries = table.get("fault", [])
        for key in table.keys() - {"fault"}:
            faults.append(f"unknown table {shown(key)}, allowed fault")
        if not isinstance(entries, list):
            raise ScheduleError(
                file, [*faults, f"fault is {shown(entries)}, allowed [[fault]] tables"]
            )
        read = [
            _read_entry(entry, f"fault {i}: ", devices, faults)
            for i, entry in enumerate(entries, start=1)
        ]
        if faults:
            raise ScheduleError(file, faults)
        return cls(tuple(sorted((f for f in read if f), key=lambda fault: fault.at)))

    def plan_actions(self) -> list[tuple[float, Action]]:
        """Return what to do at which bus time [s], in order, ends of faults included."""
        actions: list[tuple[float, Action]] = []
        for fault in self.faults:
            kind = KINDS[fault.kind]
            actions.append((fault.at, _bind(kind.start, fault)))
            if kind.end and fault.duration is not None:
                actions.append((fault.at + fault.duration, _bind(kind.end, fault)))
        return sorted(actions, key=lambda action: action[0])


@dataclass(frozen=True)
class Range:
    """Allowed values of a number in a file."""

    lower: float
    upper: float
    unit: str = ""
    whole: bool = False

    def holds(self, value: object) -> bool:
        """Tell whether a value may stand here."""
        if not is_number(value) or (self.whole and not isinstance(value, int)):
            return False
        return self.lower <= value <= self.upper

    def __str__(self) -> str:
        kind = "an integer" if self.whole else "a number"
        return f"{kind} from {self.lower:g} to {self.upper:g} {self.unit}".rstrip()


_LONGEST = 1e6  # s
RANGES: Mapping[str, Range] = {
    "at": Range(0.0, _LONGEST, "s"),
    "for": Range(0.0, _LONGEST, "s"),
    "id": Range(0, 252, whole=True),
    "rate": Range(0.0, 1.0),
    "count": Range(1, 10**9, whole=True),
    "seconds": Range(0.0, 10.0, "s"),
    "temperature": Range(-40.0, 200.0, "°C"),
    "voltage": Range(0.0, 30.0, "V"),
}
"""Allowed numbers by their names in a file."""
ERRORS = tuple(str(error.name).lower() for error in HardwareError)
_ATTRIBUTES = {"for": "duration", "id": "device"}


def _read_table(file: Path) -> dict[str, Any]:
    try:
        return tomllib.loads(file.read_text("utf-8"))
    except OSError as error:
        raise ScheduleError(file, [str(error.strerror)]) from error
    except (ValueError, RecursionError) as error:
        raise ScheduleError(file, [f"not TOML ({' '.join(str(error).split())})"]) from error


def _read_entry(
    entry: Any, owner: str, devices: Collection[int], faults: list[str]
) -> ScheduledFault | None:
    """Read one entry; None, and faults added, if anything about it is wrong."""
    if not isinstance(entry, dict):
        faults.append(f"{owner}is {shown(entry)}, allowed a table")
        return None
    name = entry.get("kind")
    if not isinstance(name, str) or name not in KINDS:
        told = f"is {shown(name)}" if "kind" in entry else "is missing"
        faults.append(f"{owner}kind {told}, allowed {', '.join(KINDS)}")
        return None
    kind, owner = KINDS[name], f"{owner}{name}: "
    found = list(_find_entry_faults(entry, kind, devices))
    faults.extend(owner + fault for fault in found)
    if found:
        return None
    content = {_ATTRIBUTES.get(str(key), str(key)): value for key, value in entry.items()}
    return ScheduledFault(**content)


def _find_entry_faults(entry: dict[str, Any], kind: Kind, devices: Collection[int]):
    needs = ("at", *kind.needs)
    allowed = ("kind", *needs, *kind.takes)
    for key in needs:
        if key not in entry:
            yield f"{key} is missing, allowed {RANGES.get(key) or ', '.join(ERRORS)}"
    for key, value in entry.items():
        if key not in allowed:
            yield f"unknown field {shown(key)}, allowed {', '.join(allowed)}"
        elif key == "error" and value not in ERRORS:
            yield f"error is {shown(value)}, allowed {', '.join(ERRORS)}"
        elif key in RANGES and not RANGES[key].holds(value):
            yield f"{key} is {shown(value)}, allowed {RANGES[key]}"
        elif key == "id" and devices and value not in devices:
            yield f"id is {value}, allowed {', '.join(map(str, sorted(devices)))}"
    if "rate" in entry and ("count" in entry or "id" in entry):
        yield "has a rate and also a count or an id, allowed one or the other"
    if "for" in entry and "rate" in kind.takes and "rate" not in entry:
        yield "has a time to last and no rate, allowed a rate"


def _bind(act: Callable[[Faults, Any], None], fault: ScheduledFault) -> Action:
    return lambda faults: act(faults, fault)
