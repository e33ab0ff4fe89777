"""Requests to get a robot up, or to hold it: `rise`, `run`, `play`, `sit` and `hold`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from tyro.conf import arg

from humanoid_getup.commands.backend_options import OriginOption, ViewOptions
from humanoid_getup.commands.options import (
    A_REAL_ROBOT,
    BodyOption,
)
from humanoid_getup.commands.values import between

REPORT, MOTION, STRIP, TORQUE = "report.json", "motion.npz", "strip.png", "torque.png"
STYLE = "style.png"
MP4 = ".mp4"
VIDEOS = (MP4, ".gif", ".webp")
ARTEFACTS = (MOTION, STRIP, TORQUE, STYLE, REPORT)


@dataclass(frozen=True, kw_only=True)
class WatchRequest(BodyOption, OriginOption, ViewOptions):
    """Read a limp robot while a person turns it by hand: torque goes off, and stays off.

    A simulated robot lies on its back, or as --from says; a real one is supported by a person.
    """

    seconds: Annotated[float | None, between(0.001, 1e6, "s"), arg(metavar="S")] = None
    """Time after which it ends [s], which is simulated as fast as possible without --realtime;
    default: when q is pressed, with a simulated robot at the pace of the clock."""

    def find_problems(self) -> list[str]:
        """Report another body of a real robot as well."""
        problems = super().find_problems()
        return problems + (self.refuse_body(A_REAL_ROBOT) if self.is_real else [])

    @property
    def start(self) -> str:
        """Start of a simulated robot."""
        return self.origin or "supine"

    @property
    def is_paced(self) -> bool:
        """Return whether cycles wait for the clock of the wall."""
        return self.is_realtime or self.seconds is None
