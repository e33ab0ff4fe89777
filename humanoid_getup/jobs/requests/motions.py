"""Requests to make motions: from keyframes, other robots, policies, files and motion capture."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal

from tyro.conf import Positional, arg

from humanoid_getup.commands.files import MADE, READ, ROBOT, WRITTEN
from humanoid_getup.commands.options import (
    NO_ORIGIN,
    BodyOption,
    Count,
    EngineOptions,
    JobRequest,
    Keys,
    Origin,
    Prefer,
    RobotOption,
    SceneOptions,
    Seed,
    TorqueLimitValue,
)
from humanoid_getup.commands.output_files import find_file_problems
from humanoid_getup.commands.values import at_least, between

MOST_SEED = 2**31  # that CMA-ES takes
MOST_PAGE = 255  # of an action file
CLIPS = "FILE.bvh, or FILE.asf FILE.amc"
NOT_OF_NAMES = re.compile(r"[^\w.-]+")
SUFFIX = ".npz"
KeyframesFile = Annotated[Path | None, READ, arg(metavar="FILE")]


@dataclass(frozen=True, kw_only=True)
class BuildRequest(EngineOptions, RobotOption):
    """Build rising motions from keyframes into the robot's folder."""

    names: Positional[tuple[str, ...]] = ()
    """Motions to build; default: all of the robot's keyframes."""
    generations: Count = 20
    """Generations of the search that optimizes the keyframes."""
    seed: Annotated[int, between(0, MOST_SEED), arg(help="Random seed.")] = 0
    prefer: Prefer | None = None
    """What a motion should be besides successful; default: as in its keyframes."""
    resume: bool = False
    """Continue searches that were interrupted, or that need more generations: see the folder
    unfinished of the robot."""
    keep_keys: bool = False
    """Write the optimized keys of motions that are built back into the keyframes."""


@dataclass(frozen=True, kw_only=True)
class RetargetRequest(BuildRequest):
    """Transfer the keyframes of another robot: point the limbs the same way, keep the motions
    that stand, and improve those that rarely do as `getup motions build` does."""

    robot: Annotated[str, ROBOT] = field()
    """Robot to which the motions are added: a name, or a folder with a robot.toml."""
    source: Annotated[str, ROBOT, arg(metavar="NAME|DIR")] = "op3"
    """Robot whose keyframes are transferred."""
    improve: bool = True
    """Improve the motions that stand in less than 80 % of disturbed worlds, or not at all."""


@dataclass(frozen=True, kw_only=True)
class DiscoverRequest(EngineOptions, RobotOption):
    """Find motions of a robot that has none: search in physics how it gets up from each side.

    From lying, the servos' targets move from one posture in which the robot rests to the next,
    until it stands. With a policy, its rises become motions instead: replayed without feedback,
    as smooth as they still stand. Either way, what stands in few disturbed worlds is not kept.
    """

    policy: Annotated[
        Positional[str],
        READ,
        arg(
            metavar="POLICY",
            help="Name of a policy of the robot, or an .onnx file, whose rises become motions; "
            "default: none, a search.",
        ),
    ] = ""
    robot: Annotated[str, ROBOT, arg(metavar="NAME|DIR,...")] = ""
    """Names of robots, or folders with a robot.toml; the engine runs one search for each. Default:
    op3, or the policy file's robot."""
    sides: Annotated[tuple[str, ...], arg(metavar="SIDE,...")] = ()
    """Sides from which motions are searched: supine, prone, left; those from the right mirror
    those from the left, unless a limp joint makes them differ; default: all."""
    most: Count = 2
    """Motions from each side, of different ways up."""
    budget: Annotated[float | None, between(1.0, 1e9, "s"), arg(metavar="S")] = None
    """Simulated time for a search [s], after which the round that has begun is finished; default:
    300,000 s."""
    torque_limit: TorqueLimitValue = None
    resume: bool = False
    """Go on with the search that ended or was interrupted, for another budget."""
    rises: Annotated[int | None, at_least(2)] = None
    """Rises of a policy from each side; default: 48."""
    seed: Seed = 0
    picture: Annotated[Path | None, WRITTEN, arg(metavar="FILE.png")] = None
    """Picture of the motions to write; default: ROBOT_motions.png."""

    @property
    def robots(self) -> tuple[str, ...]:
        """Return the robots."""
        return tuple(self.robot.split(","))

    def find_problems(self) -> list[str]:
        """Report options of a search with a policy, and the reverse, as well."""
        problems = super().find_problems()
        if len(self.robots) > 1 and self.picture is not None:
            problems.append("--picture is given, expected none with several robots")
        if len(self.robots) > 1 and self.policy:
            problems.append(f"--robot is {self.robot}, expected one with a policy")
        if not self.policy:
            given = ["--rises"] if self.rises is not None else []
            return problems + [f"{name} is given, expected none without a policy" for name in given]
        given = ["--budget"] if self.budget is not None else []
        given += ["--resume"] if self.resume else []
        given += ["--torque-limit"] if self.torque_limit is not None else []
        given += ["--engine"] if self.engine != EngineOptions.engine else []
        return problems + [f"{name} is given, expected none with a policy" for name in given]


@dataclass(frozen=True, kw_only=True)
class NewKeysOptions(JobRequest):
    """Options for new keys."""

    start: Literal["supine", "prone", "left", "right", "squat", "standing"] | None = None
    """Posture class from which the keys start; default: the one from which they come nearest to a
    stand in simulation."""
    out: KeyframesFile = None
    """Keyframes file (.toml) to which the keys are added; default: the robot's keyframes.toml."""


@dataclass(frozen=True, kw_only=True)
class ImportKeysRequest(NewKeysOptions, RobotOption):
    """Add the keys of another program's file to the robot's keyframes.

    The file is a ROBOTIS action file (.bin), a JSON animation (.json) with keyframes of goals in
    degrees, a table (.csv) with a column time and one for each joint, or a JointTrajectory of ROS
    (.yaml, .json).
    """

    file: Annotated[Positional[Path], READ, arg(metavar="FILE")]
    """File of another program: .bin, .json, .csv or .yaml."""
    page: Annotated[tuple[int, ...], arg(metavar="N,...")] = ()
    """Pages of an action file; their following pages are played as well."""
    name: str = ""
    """Name of the motion; default: as in the file."""
    end: Literal["standing", "supine", "prone", "left", "right"] = "standing"
    """What the keys end in: a stand, or the side on which the robot lies."""
    clip: bool = False
    """Clip angles outside a joint's range to its ends instead of refusing them."""

    def find_problems(self) -> list[str]:
        """Report impossible pages as well."""
        problems = super().find_problems()
        problems += [
            f"--page is {page}, expected 1 to {MOST_PAGE}"
            for page in self.page
            if not 1 <= page <= MOST_PAGE
        ]
        if self.name and len(self.page) > 1:
            problems.append(f"--name is given with {len(self.page)} pages, expected one")
        return problems


@dataclass(frozen=True, kw_only=True)
class ClipRequest(RobotOption):
    """Make a motion of a robot from a clip: its limbs point as those of the body.

    The motion is made without physics: `getup play` shows whether it can be played.
    """

    files: Annotated[Positional[tuple[Path, ...]], READ, arg(metavar="FILE.bvh|FILE.asf FILE.amc")]
    """Clip of motion capture: a .bvh file, or an .amc file and its skeleton."""
    begin: Annotated[float | None, arg(metavar="S")] = None
    """Time of the clip at which the motion begins [s]; default: its beginning."""
    end: Annotated[float | None, arg(metavar="S")] = None
    """Time at which it ends [s]; default: its end."""
    finish: bool = False
    """End in the robot's stance, however the clip ends."""
    rate: Annotated[float | None, between(1.0, 10_000.0, "Hz"), arg(metavar="HZ")] = None
    """Frames per second of an .amc clip [Hz], which its file does not say; default: 120."""
    up: Literal["y", "z"] | None = None
    """Axis of the clip that points up; default: y."""
    name: str = ""
    """Name of the motion; default: that of the clip's file."""
    out: Annotated[Path | None, MADE, arg(metavar="FILE.npz")] = None
    """Motion file to write; default: the motion's name in the working folder."""

    @property
    def clip(self) -> Path:
        """Return the file of the movement."""
        return self.files[-1]

    @property
    def skeleton(self) -> Path | None:
        """Return the separate file of the skeleton, if any."""
        return self.files[0] if len(self.files) > 1 else None

    @property
    def motion_name(self) -> str:
        """Return the name of the motion."""
        return self.name or NOT_OF_NAMES.sub("_", self.clip.stem)

    @property
    def target(self) -> Path:
        """Return the file to write."""
        return self.out or Path(f"{self.motion_name}{SUFFIX}")

    def find_problems(self) -> list[str]:
        """Report wrong files, times in the wrong order, and a wrong output as well."""
        problems = super().find_problems()
        kinds = [file.suffix.lower() for file in self.files]
        if kinds not in ([".bvh"], [".amc"], [".asf", ".amc"]):
            given = " ".join(map(str, self.files)) or "missing"
            return [*problems, f"the clip is {given}, expected {CLIPS}"]
        if self.rate is not None and kinds == [".bvh"]:
            problems.append("--rate is given, expected none with a .bvh file: it says its own")
        begin, end = self.begin or 0.0, math.inf if self.end is None else self.end
        if not 0.0 <= begin < math.inf or math.isnan(end):
            problems.append(f"--begin is {begin:g} s, --end {end:g} s, expected times from 0 s on")
        elif not begin < end:
            problems.append(f"--begin is {begin:g} s, expected before --end, {end:g} s")
        if self.target.suffix != SUFFIX:
            problems.append(f"--out is {self.target}, expected a name that ends with {SUFFIX}")
        return problems if self.out else problems + find_file_problems(self.target)


@dataclass(frozen=True, kw_only=True)
class PreviewRequest(RobotOption):
    """Draw the keys of a motion, play them once as they are, and print the outcome.

    Above, each key without physics; below, the rollout, undisturbed and at full torque.
    """

    name: Positional[str]
    """Name of a motion in the keyframes."""
    keyframes: KeyframesFile = None
    """Keyframes file (.toml); default: the robot's keyframes.toml."""
    picture: Annotated[Path | None, WRITTEN, arg(metavar="FILE.png")] = None
    """Picture to write; default: NAME.png."""


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
