"""Options of `getup style list`, `show`, `edit` and `extract`."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from tyro.conf import Positional, arg

from humanoid_getup.cli.checks import positive
from humanoid_getup.cli.options.shared import BodyOption, JsonOption, RobotOption
from humanoid_getup.cli.output import find_file_faults

StyleName = Annotated[
    str, arg(metavar="STYLE", help="Name of a style, see `getup style list`, or a style file.")
]
StyleOut = Annotated[Path, arg(metavar="FILE.toml")]
SUFFIX = ".toml"


@dataclass(frozen=True, kw_only=True)
class ListStyles(BodyOption, JsonOption, RobotOption):
    """List the styles that have a name."""


@dataclass(frozen=True, kw_only=True)
class ShowStyles(BodyOption, JsonOption, RobotOption):
    """Print the control points of styles, and draw their curves."""

    styles: Annotated[Positional[tuple[str, ...]], arg(metavar="STYLE...")]
    """Names of styles, or style files."""
    picture: Annotated[Path | None, arg(metavar="FILE.png")] = None
    """Picture to write of the curves: each style's mean, and how several ways of lying differ."""

    def find_faults(self) -> list[str]:
        """Report a picture that cannot be written, and no style at all, too."""
        faults = super().find_faults()
        if not self.styles:
            faults.append("there is no STYLE, expected one or more names or files")
        if self.picture is None:
            return faults
        if self.json is not None and Path(self.json) == self.picture:
            faults.append(f"--json and --picture are both {self.picture}, expected two files")
        return faults + find_file_faults(self.picture)


@dataclass(frozen=True, kw_only=True)
class StyleOutput(BodyOption, RobotOption):
    """Where a style is written."""

    out: StyleOut
    """Style file to write; an existing file is replaced."""

    def find_faults(self) -> list[str]:
        """Report a file that cannot be written, too."""
        faults = super().find_faults() + find_file_faults(self.out)
        if self.out.suffix != SUFFIX:
            faults.append(f"--out is {self.out}, expected a name that ends with {SUFFIX}")
        return faults


@dataclass(frozen=True, kw_only=True)
class EditStyle(StyleOutput):
    """Edit a style: its duration first, then the time of the rise, then a hold."""

    style: Positional[StyleName]
    slower: Annotated[float | None, positive(), arg(metavar="FACTOR")] = None
    """Factor on the duration."""
    faster: Annotated[float | None, positive(), arg(metavar="FACTOR")] = None
    """Divisor of the duration."""
    sooner: Annotated[float | None, positive("s"), arg(metavar="S")] = None
    """Raise the neck so much sooner [s]; the duration stays."""
    later: Annotated[float | None, positive("s"), arg(metavar="S")] = None
    """Raise the neck so much later [s]; the duration stays."""
    hold: Annotated[tuple[float, float] | None, arg(metavar="AT,S")] = None
    """Hold what is wanted at a time [s] for so long [s]."""

    def find_faults(self) -> list[str]:
        """Report edits that contradict each other, or none, too."""
        faults = super().find_faults()
        for one, other in (("slower", "faster"), ("sooner", "later")):
            if getattr(self, one) is not None and getattr(self, other) is not None:
                faults.append(f"--{one} and --{other} are given, expected one of them")
        if self.hold is not None and not (
            0.0 <= self.hold[0] < math.inf and 0.0 < self.hold[1] < math.inf
        ):
            at, lasting = self.hold
            faults.append(
                f"--hold is {at:g},{lasting:g}, expected a time from 0 s and a duration above 0 s"
            )
        edits = (self.slower, self.faster, self.sooner, self.later, self.hold)
        if all(edit is None for edit in edits):
            faults.append(
                "no edit is given, expected --slower, --faster, --sooner, --later, --hold"
            )
        return faults


@dataclass(frozen=True, kw_only=True)
class ExtractStyle(StyleOutput):
    """Extract a style from a motion, a flight log, or a clip of motion capture."""

    source: Annotated[Positional[str], arg(metavar="MOTION|FILE")]
    """Name of a motion, or a file: .npz motion, .mcap flight log, .bvh or .amc clip."""
    skeleton: Annotated[Path | None, arg(metavar="FILE.asf")] = None
    """Skeleton of an .amc clip; default: the .asf file of the same subject beside it."""
    rate: Annotated[float | None, positive("Hz"), arg(metavar="HZ")] = None
    """Frames per second of an .amc clip [Hz], which its file does not say; default: 120."""
    up: Literal["y", "z"] | None = None
    """Axis of a clip that points up; default: y."""
    begin: Annotated[float | None, arg(metavar="S")] = None
    """Time at which the rise begins [s]; default: when something moves first."""
    end: Annotated[float | None, arg(metavar="S")] = None
    """Time at which it ends [s]; default: when everything has come to rest."""
    finish: bool = False
    """Let the last control point be a stand, whatever the source ends with."""

    def find_faults(self) -> list[str]:
        """Report times in the wrong order, too."""
        faults = super().find_faults()
        if self.begin is not None and self.end is not None and not self.begin < self.end:
            faults.append(f"--begin is {self.begin:g} s, expected before --end, {self.end:g} s")
        return faults
