"""Options of `robots`, `scenes`, `motions`, `plan-cache`, `preflight` and `replay`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg

from humanoid_getup.cli.checks import between, positive
from humanoid_getup.cli.options.shared import (
    BodyOption,
    CacheFolder,
    Count,
    JsonOption,
    MotionName,
    Prefer,
    RobotOption,
    Seed,
    TorqueOptions,
    WorldOptions,
)
from humanoid_getup.cli.output import find_folder_faults

MOST_SEED = 2**31  # that CMA-ES takes
REPLAY_FILES = ("replay.json", "flight.png", "replay.png", "style.png")


@dataclass(frozen=True, kw_only=True)
class ListRobots(JsonOption):
    """List the robots that come with the program."""


@dataclass(frozen=True, kw_only=True)
class ListScenes(BodyOption, JsonOption, RobotOption):
    """List the scenes in which a robot may lie, or draw them."""

    scene: Positional[str] = ""
    """Name of a scene or a scene file (.toml); default: all that have a name."""
    seed: Seed = 0
    picture: Annotated[Path | None, arg(metavar="FILE.png")] = None
    """Picture to write of a robot that lies in each scene; of one scene alone, in each of its
    ways."""


@dataclass(frozen=True, kw_only=True)
class ListPlanCache(JsonOption):
    """List the solved rises that are kept, or remove them."""

    robot: str | None = None
    """Name of a robot; default: all."""
    cache_folder: CacheFolder = None
    clear: bool = False
    """Remove them, damaged ones too."""

    def find_faults(self) -> list[str]:
        """Report a folder that does not exist, too."""
        faults = super().find_faults()
        if self.cache_folder is not None and not self.cache_folder.is_dir():
            faults.append(f"--cache-folder is {self.cache_folder}, expected an existing folder")
        return faults


@dataclass(frozen=True, kw_only=True)
class ListMotions(BodyOption, JsonOption, RobotOption):
    """List a robot's rising motions."""


@dataclass(frozen=True, kw_only=True)
class BuildMotions(RobotOption):
    """Build rising motions from keyframes into the robot's folder."""

    names: Positional[tuple[str, ...]] = ()
    """Motions to build; default: all of the robot's keyframes."""
    generations: Count = 20
    """Generations of the search that optimizes the keyframes."""
    seed: Annotated[int, between(0, MOST_SEED), arg(help="Random seed.")] = 0
    prefer: Prefer | None = None
    """What a motion should be besides successful; default: what its keyframes say."""
    jobs: Count = 2
    """Motions that are built in parallel."""
    resume: bool = False
    """Go on with searches that were interrupted, or that need more generations: see the folder
    unfinished of the robot."""
    keep_keys: bool = False
    """Write the optimized keys of motions that are built back into the keyframes."""


@dataclass(frozen=True, kw_only=True)
class RetargetMotions(BuildMotions):
    """Take the keyframes of another robot: point the limbs the same way, keep the motions that
    stand so, and improve the others as `getup motions build` does."""

    source: Annotated[str, arg(metavar="NAME|DIR")] = "op3"
    """Robot whose keyframes are taken."""
    improve: bool = True
    """Improve the motions that do not stand as they are."""


@dataclass(frozen=True, kw_only=True)
class ShowMotion(BodyOption, RobotOption):
    """Draw a rising motion as a film strip."""

    motion: Positional[MotionName]
    picture: Annotated[Path | None, arg(metavar="FILE.png")] = None
    """Picture to write; default: MOTION.png."""


@dataclass(frozen=True, kw_only=True)
class Preflight(TorqueOptions, WorldOptions):
    """Judge a motion by limits, speed, torque at a supply, heat and self-collision."""

    motion: Positional[MotionName]
    voltage: Annotated[float | None, positive("V"), arg(metavar="V")] = None
    """Supply voltage at the servos [V]; default: the robot's nominal one."""
    temperature: Annotated[float, between(-50.0, 150.0, "°C"), arg(metavar="°C")] = 25.0
    """Temperature of all servos before the rise [°C]."""


@dataclass(frozen=True, kw_only=True)
class Replay(JsonOption):
    """Replay a flight log on the twin and report the differences."""

    log: Annotated[Positional[Path], arg(metavar="LOG")]
    """A flight log (.mcap)."""
    robot: str | None = None
    """Name of a robot, or a folder with a robot.toml; default: the log's robot."""
    scene: str | None = None
    """Name of a scene; default: the log's scene, else flat."""
    voltage: Annotated[float | None, positive("V"), arg(metavar="V")] = None
    """Supply voltage of the twin [V]; default: as measured at the start."""
    threshold: Annotated[float | None, positive("rad"), arg(metavar="RAD")] = None
    """Difference of a joint or of the tilt from which the replay has diverged [rad];
    default: 0.05."""
    out: Annotated[Path | None, arg(metavar="DIR")] = None
    """Folder for replay.json, flight.png and replay.png."""

    def find_faults(self) -> list[str]:
        """Report a folder that cannot be written, too."""
        faults = super().find_faults()
        return faults if self.out is None else faults + find_folder_faults(self.out, REPLAY_FILES)
