"""Options of `getup plan`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import arg

from humanoid_getup.cli.options.shared import NO_ORIGIN, Count, Keys, Origin, WorldOptions
from humanoid_getup.cli.output import find_folder_faults

PATH, STRIP = "path.npz", "strip.png"
PLAN_FILES = (PATH, STRIP)


@dataclass(frozen=True, kw_only=True)
class Plan(WorldOptions):
    """Plan a path from a lying posture to a stored motion, or to any posture; no physics."""

    origin: Origin = None
    key: Keys = ()
    to: Annotated[str | None, arg(metavar="FILE|motions:NAME@TIME")] = None
    """Where the path ends: a posture file, or a frame of a motion by its time [s]; default: the
    nearest postures at which stored motions are joined, in turn."""
    max_checks: Count = 300_000
    """Postures that may be checked for collisions, for each path between two postures."""
    refinement: bool = True
    """Where there is no path, loosen the constraints and tighten them step by step."""
    keep_partial: bool = False
    """If no path is found, save how far the best one leads."""
    out: Annotated[Path | None, arg(metavar="DIR")] = None
    """Folder for path.npz and strip.png."""

    def find_faults(self) -> list[str]:
        """Report a start that is missing, and a folder that cannot be written, too."""
        faults = super().find_faults()
        if self.origin is None:
            faults.append(NO_ORIGIN)
        if self.keep_partial and self.out is None:
            faults.append("--keep-partial: expected --out DIR with it, to save the path in")
        if self.out is not None:
            faults += find_folder_faults(self.out, PLAN_FILES)
        return faults
