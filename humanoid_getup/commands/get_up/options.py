"""Options of the commands that move a robot."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar, Literal

from tyro.conf import arg

from humanoid_getup.commands.files import READ, WRITTEN, Written
from humanoid_getup.commands.options import (
    A_REAL_ROBOT,
    NO_ORIGIN,
    BodyOption,
    OriginOption,
    TorqueOptions,
    ViewOptions,
)

REPORT, MOTION, STRIP, TORQUE = "report.json", "motion.npz", "strip.png", "torque.png"
STYLE = "style.png"
MP4 = ".mp4"
VIDEOS = (MP4, ".gif", ".webp")
ARTEFACTS = (MOTION, STRIP, TORQUE, STYLE, REPORT)
StyleOption = Annotated[
    str | None,
    READ,
    arg(
        metavar="STYLE|planned",
        help="Style that a policy with style curves follows: a name, see `getup style list`, a "
        "style file, or planned for the curves of a planned motion; default: of the styles that "
        "begin nearest to the robot, the one that turns it least.",
    ),
]


@dataclass(frozen=True, kw_only=True)
class MoveOptions(TorqueOptions, ViewOptions):
    """Options of every command that moves a robot."""

    out: Annotated[Path | None, Written(ARTEFACTS), arg(metavar="DIR")] = None
    """Folder for report.json, motion.npz, flight.mcap, and the pictures strip.png, torque.png and,
    of a policy with style curves, style.png."""

    video: Annotated[Path | None, WRITTEN, arg(metavar="FILE.mp4|.gif|.webp")] = None
    """Video of how it moved; MP4 requires humanoid-getup[studio]."""

    def _find_problems(self) -> Iterator[str]:
        yield from super()._find_problems()
        if self.video is not None and self.video.suffix.lower() not in VIDEOS:
            yield (f"--video is {self.video}, expected a name ending in {', '.join(VIDEOS)}")
        if self.backend != "twin" and self.limit_by == "ideal":
            yield "--limit-by is ideal, which no servo can, expected current or pwm"
        if self.backend == "dynamixel" and isinstance(self, BodyOption):
            yield from self.refuse_body(A_REAL_ROBOT)


@dataclass(frozen=True, kw_only=True)
class GetUpOptions(MoveOptions, OriginOption):
    """Options of every command that gets a robot up."""

    then: Literal["hold", "sit", "limp", "hand-over"] | None = None
    """After a judged stand: hold it until a key is pressed, then sit and lie down (in simulated
    time or without a terminal: at once); sit and lie down at once; torque off where it stands; or
    leave torque on for another program. Default: hold; of the twin, limp."""
    balance: bool = True
    """Feed the torso's attitude back to the ankles while the robot rises and stands."""
    at: Annotated[tuple[float, float, float] | None, arg(metavar="X,Y,DEG")] = None
    """Where in its scene a real robot lies: its torso [m], and the direction in which its head
    points, from +x [deg]."""
    needs_origin: ClassVar[bool] = True
    """Whether a simulated robot has no start of its own."""

    @property
    def most_attempts(self) -> int:
        """Return the number of attempts before giving up."""
        return 1

    def _find_problems(self) -> Iterator[str]:
        yield from super()._find_problems()
        if self.at is not None and not all(math.isfinite(value) for value in self.at):
            yield f"--at is {self.at}, expected three finite numbers"
        if self.at is not None and not self.is_real:
            yield "--at is given, expected a real robot: a simulated one knows its place"
        if self.is_real and self.at is None and self.scene != "flat":
            yield f"--scene {self.scene} on a real robot requires --at X,Y,DEG"
        is_simulated = self.backend != "dynamixel"
        if self.needs_origin and is_simulated and not self.is_real and self.origin is None:
            yield NO_ORIGIN

    @property
    def ending(self) -> Literal["hold", "sit", "limp", "hand-over"]:
        """What follows a judged stand."""
        return self.then or ("limp" if self.backend == "twin" else "hold")
