"""Requests for styles of rising."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from tyro.conf import Positional, arg

from humanoid_getup.jobs.requests.files import READ, WRITTEN
from humanoid_getup.jobs.requests.shared import BodyOption, RobotOption
from humanoid_getup.jobs.requests.values import between

StyleOut = Annotated[Path, WRITTEN, arg(metavar="FILE.toml")]
SUFFIX = ".toml"


@dataclass(frozen=True, kw_only=True)
class StyleOutput(BodyOption, RobotOption):
    """Output file of a style."""

    out: StyleOut
    """Style file to write; an existing file is replaced."""

    def find_problems(self) -> list[str]:
        """Report a file of another kind as well."""
        problems = super().find_problems()
        if self.out.suffix != SUFFIX:
            problems.append(f"--out is {self.out}, expected a name that ends with {SUFFIX}")
        return problems


@dataclass(frozen=True, kw_only=True)
class ExtractRequest(StyleOutput):
    """Extract a style from a motion, a flight log, or a clip of motion capture."""

    source: Annotated[Positional[str], READ, arg(metavar="MOTION|FILE")]
    """Name of a motion, or a file: .npz motion, .mcap flight log, .bvh or .amc clip."""
    skeleton: Annotated[Path | None, READ, arg(metavar="FILE.asf")] = None
    """Skeleton of an .amc clip; default: the .asf file of the same subject beside it."""
    rate: Annotated[float | None, between(1.0, 10_000.0, "Hz"), arg(metavar="HZ")] = None
    """Frames per second of an .amc clip [Hz], which its file does not say; default: 120."""
    up: Literal["y", "z"] | None = None
    """Axis of a clip that points up; default: y."""
    begin: Annotated[float | None, arg(metavar="S")] = None
    """Time at which the rise begins [s]; default: when something moves first."""
    end: Annotated[float | None, arg(metavar="S")] = None
    """Time at which it ends [s]; default: when everything has come to rest."""
    finish: bool = False
    """Let the last control point be a stand, however the source ends."""

    def find_problems(self) -> list[str]:
        """Report times in the wrong order as well."""
        problems = super().find_problems()
        if self.begin is not None and self.end is not None and not self.begin < self.end:
            problems.append(f"--begin is {self.begin:g} s, expected before --end, {self.end:g} s")
        return problems
