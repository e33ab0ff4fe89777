"""Options of `getup mocap import`."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from tyro.conf import Positional, arg

from humanoid_getup.cli.checks import positive
from humanoid_getup.cli.options.shared import JsonOption, RobotOption
from humanoid_getup.cli.output import find_file_faults

CLIPS = "FILE.bvh, or FILE.asf FILE.amc"
NOT_OF_NAMES = re.compile(r"[^\w.-]+")
SUFFIX = ".npz"


@dataclass(frozen=True, kw_only=True)
class ImportClip(JsonOption, RobotOption):
    """Make a motion of a robot from a clip: its limbs point where those of the body do.

    The motion is kinematic: `getup play` tells what physics makes of it.
    """

    files: Annotated[Positional[tuple[Path, ...]], arg(metavar="FILE.bvh|FILE.asf FILE.amc")]
    """Clip of motion capture: a .bvh file, or an .amc file and its skeleton."""
    begin: Annotated[float | None, arg(metavar="S")] = None
    """Time of the clip at which the motion begins [s]; default: its beginning."""
    end: Annotated[float | None, arg(metavar="S")] = None
    """Time at which it ends [s]; default: its end."""
    finish: bool = False
    """Go on to the robot's stance at the end, whatever the clip ends with."""
    rate: Annotated[float | None, positive("Hz"), arg(metavar="HZ")] = None
    """Frames per second of an .amc clip [Hz], which its file does not say; default: 120."""
    up: Literal["y", "z"] | None = None
    """Axis of the clip that points up; default: y."""
    name: str = ""
    """Name of the motion; default: that of the clip's file."""
    out: Annotated[Path | None, arg(metavar="FILE.npz")] = None
    """Motion file to write; default: the motion's name in the working folder."""

    @property
    def clip(self) -> Path:
        """Return the file of the movement."""
        return self.files[-1]

    @property
    def skeleton(self) -> Path | None:
        """Return the file of the skeleton, if it is one of its own."""
        return self.files[0] if len(self.files) > 1 else None

    @property
    def motion_name(self) -> str:
        """Return the name of the motion."""
        return self.name or NOT_OF_NAMES.sub("_", self.clip.stem)

    @property
    def target(self) -> Path:
        """Return the file to write."""
        return self.out or Path(f"{self.motion_name}{SUFFIX}")

    def find_faults(self) -> list[str]:
        """Report files of other kinds, times in the wrong order, and an output, too."""
        faults = super().find_faults()
        kinds = [file.suffix.lower() for file in self.files]
        if kinds not in ([".bvh"], [".amc"], [".asf", ".amc"]):
            given = " ".join(map(str, self.files)) or "missing"
            return [*faults, f"the clip is {given}, expected {CLIPS}"]
        if self.rate is not None and kinds == [".bvh"]:
            faults.append("--rate is given, expected none with a .bvh file: it says its own")
        begin, end = self.begin or 0.0, math.inf if self.end is None else self.end
        if not 0.0 <= begin < math.inf or math.isnan(end):
            faults.append(f"--begin is {begin:g} s, --end {end:g} s, expected times from 0 s on")
        elif not begin < end:
            faults.append(f"--begin is {begin:g} s, expected before --end, {end:g} s")
        if self.target.suffix != SUFFIX:
            faults.append(f"--out is {self.target}, expected a name that ends with {SUFFIX}")
        return faults + find_file_faults(self.target)
