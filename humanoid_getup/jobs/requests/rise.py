"""Requests to get a robot up, or to hold it: `rise`, `run`, `play`, `sit` and `hold`."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar, Literal

from tyro.conf import Positional, arg

from humanoid_getup.commands.backend_options import OriginOption, ViewOptions
from humanoid_getup.commands.files import READ, ROBOT, WRITTEN, Written
from humanoid_getup.commands.options import (
    A_POLICY,
    A_REAL_ROBOT,
    NO_ORIGIN,
    BodyOption,
    Count,
    Keys,
    MotionName,
    PolicyName,
    PreferenceOptions,
    SceneOptions,
    TorqueOptions,
)
from humanoid_getup.commands.values import between

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

    def find_problems(self) -> list[str]:
        """Report a wrong torque limit, body or video as well."""
        problems = super().find_problems()
        if self.video is not None and self.video.suffix.lower() not in VIDEOS:
            problems.append(
                f"--video is {self.video}, expected a name ending in {', '.join(VIDEOS)}"
            )
        if self.backend != "twin" and self.limit_by == "ideal":
            problems.append("--limit-by is ideal, which no servo can, expected current or pwm")
        if self.backend == "dynamixel" and isinstance(self, BodyOption):
            problems += self.refuse_body(A_REAL_ROBOT)
        return problems


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

    def find_problems(self) -> list[str]:
        """Report a wrong start as well."""
        problems = super().find_problems()
        if self.at is not None and not all(math.isfinite(value) for value in self.at):
            problems.append(f"--at is {self.at}, expected three finite numbers")
        if self.at is not None and not self.is_real:
            problems.append("--at is given, expected a real robot: a simulated one knows its place")
        if self.is_real and self.at is None and self.scene != "flat":
            problems.append(f"--scene {self.scene} on a real robot requires --at X,Y,DEG")
        is_simulated = self.backend != "dynamixel"
        if self.needs_origin and is_simulated and not self.is_real and self.origin is None:
            problems.append(NO_ORIGIN)
        return problems

    @property
    def ending(self) -> Literal["hold", "sit", "limp", "hand-over"]:
        """What follows a judged stand."""
        return self.then or ("limp" if self.backend == "twin" else "hold")


@dataclass(frozen=True, kw_only=True)
class RiseRequest(BodyOption, PreferenceOptions, GetUpOptions):
    """Get up from a fall: plan, filter through physics, play, judge; or run a policy."""

    attempts: Count = 3
    """Number of attempts before giving up."""
    method: Literal["plan", "policy", "auto"] = "plan"
    """Plan a motion, run a policy, or use the one with the better track record for the start."""
    policy: PolicyName | None = None
    """With --method policy or auto; default: robust, or styled with --style."""
    style: StyleOption = None
    planning: bool = True
    """Plan a collision-free path to the rising motion; otherwise interpolate."""
    filtering: bool = True
    """Filter the path through physics; otherwise play it unfiltered (simulated robots only)."""
    key: Keys = ()

    @property
    def most_attempts(self) -> int:
        """Return the number of attempts before giving up."""
        return self.attempts

    def find_problems(self) -> list[str]:
        """Report options that do not fit the backend or each other as well."""
        problems = super().find_problems() + self._find_unused()
        if self.is_real and not self.filtering:
            problems.append("--no-filtering requires a simulated robot")
        return problems

    def _find_unused(self) -> list[str]:
        """Report options of plans given for a policy, and the reverse."""
        problems = []
        if self.method == "plan" and self.policy is not None:
            problems.append(f"--policy is {self.policy}, expected --method policy or auto with it")
        given = {
            f"--prefer {self.prefer}": self.prefer != "time",
            "--search-budget": self.search_budget != PreferenceOptions.search_budget,
        }
        named = " and ".join(name for name, is_given in given.items() if is_given)
        if named and self.method == "policy":
            problems.append(f"{named}: expected --method plan or auto with it")
        if self.style is not None and self.method != "policy":
            problems.append(f"--style is {self.style}, expected --method policy with it")
        if self.method == "policy":
            problems += self.refuse_body(A_POLICY)
        if self.key and not (self.method == "plan" and self.planning and self.filtering):
            problems.append("--key: expected --method plan with it, planning and filtering")
        if named and not self.filtering:
            problems.append(f"{named}: expected filtering, not --no-filtering")
        return problems


@dataclass(frozen=True, kw_only=True)
class RunRequest(GetUpOptions):
    """Run a trained policy once, supervised, and judge how it ends."""

    policy: Positional[PolicyName]
    robot: Annotated[str, ROBOT] = ""
    """Name of a robot, or a folder with a robot.toml; default: that of a policy file, else op3."""
    style: StyleOption = None
    longest: Annotated[float | None, between(0.001, 1e6, "s"), arg(metavar="S")] = None
    """Time after which the run ends, standing or not [s]; default: 12."""


@dataclass(frozen=True, kw_only=True)
class PlayRequest(BodyOption, GetUpOptions):
    """Play a rising motion and judge how it ends."""

    motion: Positional[MotionName]
    needs_origin: ClassVar[bool] = False
    preflight: bool = True
    """Play only what the preflight passes; --no-preflight requires a simulated robot."""
    without_imu: bool = False
    """Play it with a robot that has no IMU: open loop; whether it stands is unknown. Where it is
    held in the end, a key press switches torque off."""

    def find_problems(self) -> list[str]:
        """Report an option that does not fit the backend as well."""
        problems = super().find_problems()
        if self.is_real and not self.preflight:
            problems.append("--no-preflight requires a simulated robot")
        return problems + (self._find_blind_problems() if self.without_imu else [])

    def _find_blind_problems(self) -> list[str]:
        """Report options that require an orientation."""
        problems = []
        if self.then not in (None, "hold", "limp"):
            problems.append(
                f"--then is {self.then}, expected hold or limp with --without-imu: it is "
                "unknown whether the robot stands"
            )
        if self.scene != "flat":
            problems.append(f"--scene is {self.scene}, expected flat with --without-imu")
        return problems


@dataclass(frozen=True, kw_only=True)
class SitRequest(BodyOption, MoveOptions):
    """Sit and lie down from a stand, then torque off.

    A simulated robot starts standing; a real one is held by a person until it moves.
    """

    then: ClassVar[Literal["sit"]] = "sit"
    ending: ClassVar[Literal["sit"]] = "sit"


@dataclass(frozen=True, kw_only=True)
class HoldRequest(BodyOption, MoveOptions):
    """Hold a robot in its stand, supervised, until a key is pressed.

    A simulated robot starts standing; a real one is held by a person until it has torque. In
    simulated time or without a terminal, the stand is held just long enough to be judged.
    """

    then: Literal["sit", "limp", "hand-over"] = "sit"
    """After that: sit and lie down, torque off where it stands, or leave torque on for another
    program."""

    @property
    def ending(self) -> Literal["hold", "limp", "hand-over"]:
        """What the robot does: it is always held first."""
        return "hold" if self.then == "sit" else self.then


@dataclass(frozen=True, kw_only=True)
class FallRequest(BodyOption, SceneOptions):
    """Drop a limp robot until it comes to lie on a side, and write how it lies as a posture file.

    `getup rise --from FILE` with the same options gets it up as `getup rise --from SIDE` does.
    """

    origin: Annotated[
        Literal["supine", "prone", "left", "right"],
        arg(name="from", help="Side on which the robot comes to lie."),
    ]
    out: Annotated[Path | None, WRITTEN, arg(metavar="FILE.json")] = None
    """Posture file to write."""

    def find_problems(self) -> list[str]:
        """Report a posture that is written nowhere as well."""
        problems = super().find_problems()
        if self.out is None and not getattr(self, "json", None):
            problems.append("--out is missing, expected a posture file to write, or --json -")
        return problems


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
