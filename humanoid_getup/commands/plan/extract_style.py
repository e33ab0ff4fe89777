"""`getup style extract`: the style of a motion, a flight log or a clip of motion capture."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
from rich.console import Console
from rich.markup import escape
from tyro.conf import Positional, arg

from humanoid_getup.clips.clip_file import ACCLAIM, CLIPS, read_clip
from humanoid_getup.commands.command import command
from humanoid_getup.commands.errors import BadInputError, refusing
from humanoid_getup.commands.files import READ
from humanoid_getup.commands.inputs import find_motion, load_robot
from humanoid_getup.commands.options import ClipOptions
from humanoid_getup.commands.plan.styles import StyleOutput, print_times
from humanoid_getup.progress.callback import ProgressMonitor
from humanoid_getup.strategies.learned_rise import measure_motion
from humanoid_getup.style.curves import UPRIGHT_STAND, extract_curves, is_stand, measure_clip, trim
from humanoid_getup.style.features import FeatureSense
from humanoid_getup.style.style import Style, write_style
from robots import Robot
from robots.body.parts import leg_length
from robots.kinematics import GravitySense, imu_in_torso
from robots.quaternion import Array

MOTION, LOG = ".npz", ".mcap"


@dataclass(frozen=True, kw_only=True)
class ExtractRequest(ClipOptions, StyleOutput):
    """Extract a style from a motion, a flight log, or a clip of motion capture."""

    source: Annotated[Positional[str], READ, arg(metavar="MOTION|FILE")]
    """Name of a motion, or a file: .npz motion, .mcap flight log, or a clip (.bvh, .amc,
    .json, .txt)."""
    skeleton: Annotated[Path | None, READ, arg(metavar="FILE.asf")] = None
    """Skeleton of an .amc clip; default: the .asf file of the same subject beside it."""
    begin: Annotated[float | None, arg(metavar="S")] = None
    """Time at which the rise begins [s]; default: when something moves first."""
    end: Annotated[float | None, arg(metavar="S")] = None
    """Time at which it ends [s]; default: when everything has come to rest."""
    finish: bool = False
    """Let the curves end in a stand, however the source ends."""

    def _find_problems(self) -> Iterator[str]:
        yield from super()._find_problems()
        if self.begin is not None and self.end is not None and not self.begin < self.end:
            yield f"--begin is {self.begin:g} s, expected before --end, {self.end:g} s"


@command("style extract")
def extract_style(request: ExtractRequest, monitor: ProgressMonitor) -> Style:
    """Extract the curves of neck and torso from the source, and write the style's file."""
    robot = load_robot(request)
    monitor.begin("reading")
    with refusing():
        time, features, scale, source = _read_source(request, robot)
    time, features = _choose(time, features, request)
    if request.finish:
        features[-1] = UPRIGHT_STAND
    try:
        curves = extract_curves(time, features)
    except ValueError as error:
        hint = "" if is_stand(features[-1]) else " (--finish lets the last point be a stand)"
        raise BadInputError(f"{request.source}: {error}{hint}") from error
    curves = curves.lasting(curves.duration * scale)
    about = f"from {source}, {time[0]:.2f} to {time[-1]:.2f} s"
    style = Style(name=request.out.stem, about=about, curves=(curves,))
    monitor.check()
    write_style(style, robot, request.out)
    return style


@extract_style.show
def _print(style: Style, request: ExtractRequest, console: Console) -> None:
    console.print(escape(style.about), soft_wrap=True)
    print_times(request.out, style, console)


def _choose(time: Array, features: Array, request: ExtractRequest) -> tuple[Array, Array]:
    """Choose the frames of the rise, from times [s] (T,) and features (T, 3)."""
    begin = -np.inf if request.begin is None else request.begin
    end = np.inf if request.end is None else request.end
    chosen = (time >= begin - 1e-9) & (time <= end + 1e-9)
    if chosen.sum() < 2:
        raise ValueError(
            f"{request.source} lasts from {time[0]:.2f} to {time[-1]:.2f} s, expected --begin and "
            "--end within it"
        )
    time, features = time[chosen], features[chosen]
    moving = trim(features)
    first = 0 if request.begin is not None else moving.start
    last = len(time) if request.end is not None else moving.stop
    return time[first:last], features[first:last].copy()


def _read_source(request: ExtractRequest, robot: Robot) -> tuple[Array, Array, float, str]:
    """Read times [s], features (T, 3), the factor on durations for this robot, and what it is."""
    file = Path(request.source)
    kind = file.suffix.lower()
    options = ("unit", "up", "rename") * (kind in CLIPS) + ("rate", "skeleton") * (kind == ACCLAIM)
    for name in ("unit", "up", "rename", "rate", "skeleton"):
        if getattr(request, name) and name not in options:
            of = ACCLAIM if name in ("rate", "skeleton") else ", ".join(CLIPS)
            raise BadInputError(
                f"--{name} is given, expected none with {request.source}: it is of clips ({of})"
            )
    if kind == LOG:
        return *_read_log(file, robot), 1.0, file.name
    if kind in CLIPS:
        clip = read_clip(file, request.skeleton, **request.reading())
        scale = float(np.sqrt(leg_length(robot) / clip.leg_length))
        return clip.time, measure_clip(clip), scale, f"{file.name} ({clip.layout})"
    if kind and kind != MOTION and file.is_file():
        raise BadInputError(
            f"{request.source} is a file of another kind, expected {MOTION}, {LOG}, "
            f"{', '.join(CLIPS)}, or the name of a motion"
        )
    motion = find_motion(robot, request.source)
    return motion.time, measure_motion(robot, motion), 1.0, file.name


def _read_log(file: Path, robot: Robot) -> tuple[Array, Array]:
    """Estimate the features of a flight from its measurements."""
    from drivers.flight_log.reader import FlightRecord

    record = FlightRecord.load(file)
    record.check_robot(robot)
    if not record.cycles:
        raise ValueError(f"flight log {file}: contains no cycle, expected at least one")
    state = record.tracks["state"]
    known = np.isfinite(state["orientation"]).all(axis=1)
    known &= np.isfinite(state["joint_pos"]).all(axis=1)
    if not known.any():
        raise ValueError(f"flight log {file}: measures no posture, expected one or more")
    time, orientation, joint_pos = (
        state[name][known] for name in ("time", "orientation", "joint_pos")
    )
    gravity = GravitySense(imu_in_torso(robot, robot.spec().compile()))
    down = np.array([gravity(row) for row in orientation])
    return time - time[0], FeatureSense(robot, len(down))(down, joint_pos)
