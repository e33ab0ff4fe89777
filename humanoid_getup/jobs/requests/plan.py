"""Request to plan a path."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from tyro.conf import arg

from humanoid_getup.jobs.requests.files import READ
from humanoid_getup.jobs.requests.shared import (
    NO_ORIGIN,
    BodyOption,
    Keys,
    Origin,
    SceneOptions,
)
from humanoid_getup.jobs.requests.values import at_least


@dataclass(frozen=True, kw_only=True)
class PlanRequest(BodyOption, SceneOptions):
    """A path to plan, from a lying posture to a stored motion or to any posture."""

    origin: Origin = None
    key: Keys = ()
    to: Annotated[str | None, READ, arg(metavar="FILE|motions:NAME@TIME")] = None
    """Where the path ends: a posture file, or a frame of a motion by its time [s]; default: the
    nearest postures at which stored motions are joined, in turn."""
    max_checks: Annotated[int, at_least(1, at_most=10**9)] = 300_000
    """Postures that may be checked for collisions, for each path between two postures."""
    refinement: bool = True
    """If there is no path, loosen the constraints and tighten them step by step."""

    def find_problems(self) -> list[str]:
        """Report a missing start as well."""
        return super().find_problems() + ([] if self.origin else [NO_ORIGIN])
