"""The kinds of faults that a schedule may name: what each needs, does and ends with."""

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
class FaultKind:
    """What a kind of fault needs, and does."""

    start: Callable[[FaultInjector, Any], None]
    end: Callable[[FaultInjector, Any], None] | None = None
    """None where nothing ends."""
    needs: tuple[str, ...] = ()
    takes: tuple[str, ...] = ()


def _disturb_line(faults: FaultInjector, fault: ScheduledFault) -> None:
    kind = LineFault(fault.kind)
    if kind is LineFault.LATE:
        faults.set_times(late_by=fault.seconds)
    if kind is LineFault.SPLIT:
        faults.set_times(split_pause=fault.seconds)
    if fault.rate is None:
        faults.order(kind, fault.device, fault.count or 1)
    else:
        faults.set_rate(kind, fault.rate)


def _calm_line(faults: FaultInjector, fault: ScheduledFault) -> None:
    if fault.rate is not None:
        faults.set_rate(LineFault(fault.kind), 0.0)


def _line_kind(fault: LineFault) -> FaultKind:
    takes = ("rate", "count", "for")
    if fault not in (LineFault.LOSE_REQUEST, LineFault.FLIP_REQUEST, LineFault.ECHO):
        takes += ("id",)
    if fault in (LineFault.LATE, LineFault.SPLIT):
        takes += ("seconds",)
    return FaultKind(_disturb_line, _calm_line, takes=takes)


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
"""Kinds of faults by their names in a file."""

Action = Callable[[FaultInjector], None]


class FaultScheduleError(SetupError):
    """A schedule of faults that cannot be used."""

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
            file: TOML file with one ``[[fault]]`` table an entry.
            devices: Ids on the bus, to check the file's against; none for no check.

        Raises:
            FaultScheduleError: telling all that is wrong at once.
        """
        file = Path(file)
        table = _read_table(file)
        faults: list[str] = []
        entries = table.get("fault", [])
        for key in table.keys() - {"fault"}:
            faults.append(f"unknown table {shown(key)}, allowed fault")
        if not isinstance(entries, list):
            raise FaultScheduleError(
                file, [*faults, f"fault is {shown(entries)}, allowed [[fault]] tables"]
            )
        read = [
            _read_entry(entry, f"fault {i}: ", devices, faults)
            for i, entry in enumerate(entries, start=1)
        ]
        if faults:
            raise FaultScheduleError(file, faults)
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
class NumberRange:
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
"""Allowed numbers by their names in a file."""
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


def _find_entry_faults(entry: dict[str, Any], kind: FaultKind, devices: Collection[int]):
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


def _bind(act: Callable[[FaultInjector, Any], None], fault: ScheduledFault) -> Action:
    return lambda faults: act(faults, fault)
