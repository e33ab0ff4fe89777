"""Options of `getup plan`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import arg

from humanoid_getup.cli.options.shared import JsonOption
from humanoid_getup.jobs.requests.files import Written
from humanoid_getup.jobs.requests.plan import PlanRequest

PATH, STRIP = "path.npz", "strip.png"
PLAN_FILES = (PATH, STRIP)


@dataclass(frozen=True, kw_only=True)
class Plan(JsonOption, PlanRequest):
    """Plan a path from a lying posture to a stored motion, or to any posture; no physics."""

    keep_partial: bool = False
    """If no path is found, save the collision-free beginning of the best one."""
    out: Annotated[Path | None, Written(PLAN_FILES), arg(metavar="DIR")] = None
    """Folder for path.npz and strip.png."""

    def find_problems(self) -> list[str]:
        """Report --keep-partial without a folder as well."""
        problems = super().find_problems()
        if self.keep_partial and self.out is None:
            problems.append("--keep-partial: expected --out DIR with it, to save the path in")
        return problems
