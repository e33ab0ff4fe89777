"""`getup mocap import`: a clip of motion capture as a motion of a robot."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from rich.console import Console
from rich.markup import escape
from tyro.conf import Positional, arg

from humanoid_getup.clips.clip_file import ACCLAIM, CLIPS, SKELETON, read_clip
from humanoid_getup.commands.command import command
from humanoid_getup.commands.errors import DID_IT, DID_NOT_STAND, refusing
from humanoid_getup.commands.files import MADE, READ, find_file_problems
from humanoid_getup.commands.inputs import load_robot
from humanoid_getup.commands.options import ClipOptions, RobotOption, Seed
from humanoid_getup.motions.motion import NO_END, Motion
from humanoid_getup.motions.retarget_clip import ClipRetargeter, RetargetedClip
from humanoid_getup.progress.callback import ProgressMonitor
from humanoid_getup.simulation.world import World
from robots import Robot
from robots.storage.validation import between

if TYPE_CHECKING:
    from humanoid_getup.strategies.captured_rise import CapturedRise

EXPECTED = "a .bvh, .amc, .json or .txt file, or FILE.asf FILE.amc"
NOT_OF_NAMES = re.compile(r"[^\w.-]+")
SUFFIX = ".npz"
SLOWED = 1.005  # times its duration, from which a motion counts as slowed down


@dataclass(frozen=True, kw_only=True)
class ClipRequest(ClipOptions, RobotOption):
    """Make a motion of a robot from a clip: its limbs point as those of the body.

    The motion is made without physics: `getup play` shows whether it can be played. With --physics
    targets are searched with which a simulated robot follows the clip and stands.
    """

    files: Annotated[Positional[tuple[Path, ...]], READ, arg(metavar="CLIP|FILE.asf FILE.amc")]
    """Clip of motion capture: a .bvh file, an .amc file and its skeleton, or a motion of DeepMimic
    (.json, .txt)."""
    begin: Annotated[float | None, arg(metavar="S")] = None
    """Time of the clip at which the motion begins [s]; default: its beginning."""
    end: Annotated[float | None, arg(metavar="S")] = None
    """Time at which it ends [s]; default: its end."""
    finish: bool = False
    """End in the robot's stance, however the clip ends."""
    physics: bool = False
    """Search targets for a rise: the robot follows the clip in simulation, in disturbed worlds too,
    and ends in a held stand, by a stored rise of its own where the clip's end does not stand."""
    search_budget: Annotated[float, between(1.0, 1e6, "s"), arg(metavar="S")] = 20_000.0
    """Simulated time in which --physics follows and varies [s]."""
    seed: Seed = 0
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

    def _find_problems(self) -> Iterator[str]:
        yield from super()._find_problems()
        kinds = [file.suffix.lower() for file in self.files]
        if kinds not in [*([kind] for kind in CLIPS), [SKELETON, ACCLAIM]]:
            given = " ".join(map(str, self.files)) or "missing"
            yield f"the clip is {given}, expected {EXPECTED}"
            return
        made = (self.seed, self.search_budget) != (ClipRequest.seed, ClipRequest.search_budget)
        if made and not self.physics:
            yield "--seed or --search-budget is given, expected --physics with it"
        if self.rate is not None and kinds[-1] != ACCLAIM:
            yield f"--rate is given, expected none with a {kinds[-1]} file: it says its own"
        begin, end = self.begin or 0.0, math.inf if self.end is None else self.end
        if not 0.0 <= begin < math.inf or math.isnan(end):
            given = [
                f"--{name} is {value:g} s"
                for name, value in (("begin", self.begin), ("end", self.end))
                if value is not None
            ]
            yield f"{', '.join(given)}, expected times from 0 s on"
        elif not begin < end:
            yield f"--begin is {begin:g} s, expected before --end, {end:g} s"
        if self.target.suffix != SUFFIX:
            yield f"--out is {self.target}, expected a name that ends with {SUFFIX}"
        if not self.out:
            yield from find_file_problems(self.target)


@dataclass(frozen=True, kw_only=True, eq=False)
class ImportedClip:
    """A clip as a motion of a robot."""

    clip: RetargetedClip
    rise: CapturedRise | None
    """What physics made of it; None without --physics."""
    kept_file: bool = False
    """Whether it is no rise to keep, and a file that was there was left as it was."""

    @property
    def motion(self) -> Motion:
        """Return the motion that was written."""
        return self.rise.motion if self.rise else self.clip.motion


def describe(imported: ImportedClip) -> dict[str, Any]:
    """Describe a motion made from a clip, and the deviation of its limbs, for JSON."""
    motion, found, rise = imported.motion, imported.clip, imported.rise
    limb, largest = found.largest_angle
    physics = rise and {
        "stood_share": rise.share,
        "limb_error_deg": math.degrees(rise.limb_error),
        "overlap_mm": 1000.0 * rise.overlap,
        "duration_s": rise.motion.duration,
        "joined": rise.joined or None,
        "simulated_s": rise.simulated,
    }
    return (physics or {}) | {
        "name": motion.name,
        "robot": motion.robot,
        "start_class": motion.start_class,
        "end_class": motion.end_class,
        "duration_s": motion.duration,
        "slowdown": found.slowdown,
        "deviation_mean_deg": math.degrees(found.mean_angle),
        "deviation_max_deg": math.degrees(largest),
        "deviation_max_limb": limb,
        "deviation_deg": {
            name: {"mean": math.degrees(rows.mean()), "max": math.degrees(rows.max())}
            for name, rows in found.angle.items()
        },
        "bound_joints": found.bound,
        "layout": asdict(found.layout) if found.layout else None,
    }


@command("mocap import", json=describe)
def import_clip(request: ClipRequest, monitor: ProgressMonitor) -> ImportedClip:
    """Retarget the clip, make it a rise in physics on request, and write the motion."""
    robot = load_robot(request)
    monitor.begin("reading")
    with refusing():
        clip = read_clip(request.clip, request.skeleton, **request.reading())
        found = ClipRetargeter(robot).retarget(
            clip,
            name=request.motion_name,
            begin=request.begin or 0.0,
            end=math.inf if request.end is None else request.end,
            finish=request.finish or request.physics,
            report=lambda share: monitor.begin(f"pointing the limbs: {share:.0%}"),
        )
    rise = _make_rise(found, robot, request, monitor) if request.physics else None
    keeps = rise is not None and not rise.is_sound and request.target.exists()
    imported = ImportedClip(clip=found, rise=rise, kept_file=keeps)
    if not keeps:
        request.target.parent.mkdir(parents=True, exist_ok=True)
        imported.motion.save(request.target)
    return imported


def _make_rise(
    clip: RetargetedClip, robot: Robot, request: ClipRequest, monitor: ProgressMonitor
) -> CapturedRise:
    """Make a rise of a clip."""
    from humanoid_getup.strategies.captured_rise import CapturedRiseMaker  # slow to import

    maker = CapturedRiseMaker(World(robot), budget=request.search_budget, monitor=monitor)
    return maker.make(clip, request.seed)


@import_clip.show
def _print(imported: ImportedClip, request: ClipRequest, console: Console) -> int:
    found, motion = imported.clip, imported.motion
    limb, largest = found.largest_angle
    lines = [
        f"{request.clip.name}: {found.layout}",
        f"{motion.name}: {motion.duration:.2f} s from {motion.start_class}"
        + ("" if motion.end_class == NO_END else f" to {motion.end_class}"),
        f"limbs point {math.degrees(found.mean_angle):.1f}° off the clip's on average, at most "
        f"{math.degrees(largest):.0f}° (the {limb.replace('_', ' ')})",
    ]
    if found.slowdown > SLOWED:
        lines.append(f"slowed down to {found.slowdown:.2f} times its duration: servos' speed")
    if found.bound:
        bound = sorted(found.bound.items(), key=lambda pair: -pair[1])
        listed = ", ".join(f"{joint} {share:.0%}" for joint, share in bound)
        lines.append(f"joints at an end of their range, share of the frames: {listed}")
    if imported.rise:
        lines.append(str(imported.rise))
    is_sound = imported.rise is None or imported.rise.is_sound
    robot_option = "" if request.robot == "op3" else f" --robot {request.robot}"
    play = f"getup play {request.target}{robot_option}"
    again = f"another --seed, or a longer --search-budget than {request.search_budget:g} s"
    written = "kept what is in" if imported.kept_file else "written to"
    lines.append(f"{written} {request.target}; next: {play if is_sound else again}")
    for line in lines:
        console.print(escape(line), soft_wrap=True)
    return DID_IT if is_sound else DID_NOT_STAND
