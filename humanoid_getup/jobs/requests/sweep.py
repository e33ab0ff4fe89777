"""Request for a sweep over designs."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Annotated, Literal

from tyro.conf import arg

from humanoid_getup.jobs.requests.files import READ, Written
from humanoid_getup.jobs.requests.shared import (
    Count,
    EngineOptions,
    RobotOption,
    SearchBudgetOption,
    Seed,
)

SWEEP_PAGE, SWEEP_FIGURES, SWEEP_PLOT, SWEEP_LEDGER = (
    "sweep.md",
    "sweep.json",
    "sweep.png",
    "sweep.jsonl",
)
SWEEP_ARTEFACTS = (SWEEP_PAGE, SWEEP_FIGURES, SWEEP_PLOT)
MOST_VALUES = 1000  # of one range
MOST_DESIGNS = 100_000
A_RANGE = "a number, or a range FROM:TO:STEP such as 1.0:1.6:0.1"


@dataclass(frozen=True, kw_only=True)
class SweepRequest(EngineOptions, SearchBudgetOption, RobotOption):
    """Get up with many designs, to see where one stops getting up."""

    body: Annotated[str, arg(metavar="PART=FACTOR|FROM:TO:STEP,...")] = ""
    """Factors on the lengths of shoulders, arms, torso or legs, such as arms=1.0:1.6:0.1,legs=1.1.
    Masses and inertias follow."""
    servos: Annotated[tuple[str, ...], arg(metavar="TYPE,...")] = ()
    """Types of which all servos are, such as XL430-W250,XM430-W350; none for the robot's own."""
    torque_limit: Annotated[str, arg(metavar="N·m|FROM:TO:STEP")] = ""
    """Torque limits per servo [N·m]; default: stall torque."""
    limit_by: Literal["current", "pwm", "ideal"] | None = None
    """What the torque limits act on; default: the servos' own way."""
    scenes: Annotated[tuple[str, ...], READ, arg(metavar="SCENE,...")] = ("flat",)
    """Scenes by name, such as flat,slope:10, or scene files."""
    ways: Annotated[tuple[str, ...], READ, arg(metavar="WAY,...")] = ("plan",)
    """Ways to get up: plan, and policies by name or file."""
    n: Count = 5
    """Falls of each class: supine, prone, left, right."""
    seed: Seed = 0
    out: Annotated[Path, Written(SWEEP_ARTEFACTS), arg(metavar="DIR")] = Path("out/sweep")
    """Folder for sweep.md, sweep.json, sweep.png, and the ledger of finished classes."""
    resume: bool = False
    """Keep the finished classes of the ledger; ranges may be wider than before."""

    @property
    def bodies(self) -> list[str]:
        """List the bodies, in the order of the ranges."""
        axes = [[(part, value) for value in values] for part, values in self.body_ranges.items()]
        return [
            ",".join(f"{part}={value!r}" for part, value in choice if value != 1.0)
            for choice in product(*axes)
        ]

    @property
    def body_ranges(self) -> dict[str, list[float]]:
        """Return the factors of each part that is named."""
        return {part: parse_range(text) for part, text in split_parts(self.body).items()}

    @property
    def torque_limits(self) -> list[float | None]:
        """List the torque limits [N·m]; None for stall torque."""
        return list(parse_range(self.torque_limit)) if self.torque_limit else [None]

    def find_problems(self) -> list[str]:
        """Report ranges that cannot be read as well, and too many designs."""
        problems = super().find_problems()
        for option, read in (
            ("--body", lambda: self.body_ranges),
            ("--torque-limit", lambda: self.torque_limits),
        ):
            try:
                read()
            except ValueError as error:
                problems.append(f"{option} {error}")
        if problems:
            return problems
        others = max(len(self.servos), 1) * len(self.scenes) * len(self.ways)
        bodies = math.prod(map(len, self.body_ranges.values()))
        count = bodies * len(self.torque_limits) * others
        if count > MOST_DESIGNS:
            problems.append(f"the ranges are {count} designs, expected at most {MOST_DESIGNS}")
        return problems


def split_parts(text: str) -> dict[str, str]:
    """Split a text such as ``arms=1.0:1.6:0.1,legs=1.1`` into parts and ranges.

    Raises:
        ValueError: if a part has no range, or is given twice.
    """
    found = dict[str, str]()
    for item in filter(None, text.split(",")):
        part, has_range, values = (word.strip() for word in item.partition("="))
        if not has_range or not part:
            raise ValueError(f"is '{item}', expected PART=FACTOR or PART=FROM:TO:STEP")
        if part in found:
            raise ValueError(f"names {part} twice, expected it once")
        found[part] = values
    return found


def parse_range(text: str) -> list[float]:
    """Parse a number, or a range FROM:TO:STEP with both ends.

    Raises:
        ValueError: if it is neither.
    """
    try:
        numbers = [float(word) for word in text.split(":")]
    except ValueError:
        numbers = []
    if not numbers or len(numbers) == 2 or len(numbers) > 3 or not all(map(math.isfinite, numbers)):
        raise ValueError(f"is '{text}', expected {A_RANGE}")
    if len(numbers) == 1:
        return numbers
    first, last, step = numbers
    steps = (last - first) / step if step > 0.0 else math.nan
    if math.isnan(steps) or last < first:
        raise ValueError(f"is '{text}', expected a step above 0, from a lower to a higher number")
    count = math.floor(min(steps, MOST_DESIGNS) + 1e-9) + 1
    if count > MOST_VALUES:
        raise ValueError(f"is '{text}', expected at most {MOST_VALUES} values")
    return [round(first + k * step, 9) for k in range(count)]
