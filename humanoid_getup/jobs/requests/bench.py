"""Requests for benchmarks."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from tyro.conf import arg

from humanoid_getup.commands.files import WRITTEN, Written
from humanoid_getup.commands.options import (
    BodyOption,
    Count,
    EngineOptions,
    PreferenceOptions,
    RobotOption,
    SceneOptions,
    Seed,
    TorqueOptions,
)
from humanoid_getup.commands.values import at_least, between

PAGE, FIGURES, PLOT = "benchmark.md", "benchmark.json", "benchmark.png"
LEDGER = "benchmark.jsonl"
STRIPS = tuple(f"strip_{name}.png" for name in ("supine", "prone", "left", "right"))
WHOLE_ARTEFACTS = (PAGE, FIGURES, PLOT, *STRIPS)
"""Files of the whole benchmark."""


@dataclass(frozen=True, kw_only=True)
class BenchAll(EngineOptions, BodyOption, RobotOption):
    """Measure a robot as one page: every method under several torque caps, from the same falls."""

    n: Annotated[int | None, at_least(1)] = None
    """Falls of each class: supine, prone, left, right; default: 20, with --quick 4."""
    seed: Seed = 0
    limit_by: Literal["current", "pwm", "ideal"] | None = None
    """What the torque caps act on; default: the robot's own."""
    quick: bool = False
    """Fewer falls, torque caps and disturbances, for a first look."""
    out: Annotated[Path, Written(WHOLE_ARTEFACTS), arg(metavar="DIR")] = Path("out/benchmark")
    """Folder for benchmark.md, benchmark.json, pictures, and the ledger of what is finished."""
    resume: bool = False
    """Keep what is finished; it must be of the same benchmark."""

    @property
    def each(self) -> int:
        """Return the falls of each class."""
        return self.n if self.n is not None else 4 if self.quick else 20


@dataclass(frozen=True, kw_only=True)
class BenchRise(EngineOptions, PreferenceOptions, TorqueOptions, BodyOption, SceneOptions):
    """Rise from many settled falls: success rates, times and faults."""

    n: Count = 20
    """Falls of each class: supine, prone, lateral."""
    planning: bool = True
    """Plan a collision-free path to the rising motion; otherwise interpolate."""
    filtering: bool = True
    """Filter the path through physics; otherwise play it unfiltered."""
    assistance: Annotated[float, between(0.0, 1.0)] = 1.0
    """Factor on the virtual actuator's torques in the filter; with 0, no candidate has it."""
    ledger: Annotated[Path | None, WRITTEN, arg(metavar="FILE")] = None
    """File in which every finished rise is kept, for work of hours: --resume continues with it."""
    resume: bool = False
    """Keep the finished rises of the ledger; they must be of the same benchmark."""

    def find_problems(self) -> list[str]:
        """Report a benchmark that keeps nothing to resume as well."""
        problems = super().find_problems()
        if self.resume and self.ledger is None:
            problems.append("--resume is given without --ledger, expected the file of the rises")
        return problems
