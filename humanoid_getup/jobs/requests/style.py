"""Requests for styles of rising."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from tyro.conf import Positional, arg

from humanoid_getup.commands.files import READ, WRITTEN
from humanoid_getup.commands.options import BodyOption, RobotOption, Seed
from humanoid_getup.commands.values import between

StyleOut = Annotated[Path, WRITTEN, arg(metavar="FILE.toml")]
StyleName = Annotated[
    str,
    READ,
    arg(metavar="STYLE", help="Name of a style, see `getup style list`, or a style file."),
]
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


@dataclass(frozen=True, kw_only=True)
class ListStylesRequest(BodyOption, RobotOption):
    """List the named styles."""


@dataclass(frozen=True, kw_only=True)
class ShowStylesRequest(BodyOption, RobotOption):
    """Print the control points of styles, and draw their curves."""

    styles: Annotated[Positional[tuple[str, ...]], READ, arg(metavar="STYLE...")]
    """Names of styles, or style files."""
    picture: Annotated[Path | None, WRITTEN, arg(metavar="FILE.png")] = None
    """Picture of the curves to write: each style's mean, and the spread over ways of lying."""

    def find_problems(self) -> list[str]:
        """Report missing styles as well."""
        problems = super().find_problems()
        if not self.styles:
            problems.append("there is no STYLE, expected one or more names or files")
        return problems


@dataclass(frozen=True, kw_only=True)
class EditStyleRequest(StyleOutput):
    """Edit a style: its duration first, then the time of the rise, then a hold."""

    style: Positional[StyleName]
    slower: Annotated[float | None, between(1e-4, 1e4), arg(metavar="FACTOR")] = None
    """Factor on the duration."""
    faster: Annotated[float | None, between(1e-4, 1e4), arg(metavar="FACTOR")] = None
    """Divisor of the duration."""
    sooner: Annotated[float | None, between(0.001, 1000.0, "s"), arg(metavar="S")] = None
    """Time by which the neck rises sooner [s]; the duration stays."""
    later: Annotated[float | None, between(0.001, 1000.0, "s"), arg(metavar="S")] = None
    """Time by which the neck rises later [s]; the duration stays."""
    hold: Annotated[tuple[float, float] | None, arg(metavar="AT,S")] = None
    """Time whose targets are held [s], and duration of the hold [s]."""

    def find_problems(self) -> list[str]:
        """Report contradicting or missing edits as well."""
        problems = super().find_problems()
        for one, other in (("slower", "faster"), ("sooner", "later")):
            if getattr(self, one) is not None and getattr(self, other) is not None:
                problems.append(f"--{one} and --{other} are given, expected one of them")
        if self.hold is not None and not (
            0.0 <= self.hold[0] < math.inf and 0.0 < self.hold[1] < math.inf
        ):
            at, lasting = self.hold
            problems.append(
                f"--hold is {at:g},{lasting:g}, expected a time from 0 s and a duration above 0 s"
            )
        edits = (self.slower, self.faster, self.sooner, self.later, self.hold)
        if all(edit is None for edit in edits):
            problems.append(
                "no edit is given, expected --slower, --faster, --sooner, --later, --hold"
            )
        return problems


@dataclass(frozen=True, kw_only=True)
class ScenesRequest(BodyOption, RobotOption):
    """List the scenes in which a robot may lie, or draw them."""

    scene: Annotated[Positional[str], READ] = ""
    """Name of a scene, or a scene file (.toml); default: all named scenes."""
    seed: Seed = 0
    picture: Annotated[Path | None, WRITTEN, arg(metavar="FILE.png")] = None
    """Picture to write of a robot that lies in each scene; of one scene alone, in each of its
    ways."""
