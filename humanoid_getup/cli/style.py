"""`getup style`: list, show, edit and extract styles."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from rich.markup import escape

from humanoid_getup.cli.errors import BadInputError, refusing
from humanoid_getup.cli.exit_codes import DID_IT
from humanoid_getup.cli.inputs import find_motion, load_robot
from humanoid_getup.cli.options.style import EditStyle, ExtractStyle, ListStyles, ShowStyles
from humanoid_getup.cli.output import console_for, make_table, phase, to_json, write_json
from humanoid_getup.clips.clip_file import ACCLAIM, BVH, read_clip
from humanoid_getup.reporting.style_plot import save_styles
from humanoid_getup.strategies.styled_rise import measure_motion
from humanoid_getup.style.curves import UPRIGHT_STAND, StyleCurves, is_stand
from humanoid_getup.style.edits import hold, rise_time, shift_rise
from humanoid_getup.style.extraction import ExtractionError, extract_curves, measure_clip, trim
from humanoid_getup.style.features import FeatureSense
from humanoid_getup.style.style import Style
from humanoid_getup.style.style_file import list_styles as list_names
from humanoid_getup.style.style_file import load_style, write_style
from robots import Robot
from robots.body.lengths import leg_length
from robots.kinematics import GravitySense, imu_in_torso
from robots.quaternion import Array

MOTION, LOG = ".npz", ".mcap"


def list_styles(command: ListStyles) -> int:
    """Print a table or JSON of the named styles."""
    robot = load_robot(command)
    with refusing():
        rows = [_describe(load_style(name, robot)) for name in list_names()]
    write_json(to_json({"robot": robot.name, "styles": rows}), command.json)
    if command.json is None:
        texts = ("style", "about")
        table = make_table((*texts, "curves", "duration [s]", "rises at [s]"), left=texts)
        for row in rows:
            curves = row["curves"]
            table.add_row(
                row["name"],
                row["about"],
                str(len(curves)),
                _span([curve["duration_s"] for curve in curves]),
                _span([curve["rise_s"] for curve in curves]),
            )
        console_for(None).print(table)
    return DID_IT


def show(command: ShowStyles) -> int:
    """Print the control points of styles; draw them."""
    robot = load_robot(command)
    with refusing():
        styles = [load_style(name, robot) for name in command.styles]
        if command.picture is not None:
            save_styles(styles, command.picture)
    rows = [_describe(style) for style in styles]
    write_json(to_json({"robot": robot.name, "styles": rows}), command.json)
    if command.json is None:
        for row in rows:
            _print_points(row)
    return DID_IT


def edit(command: EditStyle) -> int:
    """Edit all curves of a style; write it."""
    robot = load_robot(command)
    with refusing():
        style = load_style(command.style, robot)
        curves = tuple(_edit(curve, command) for curve in style.curves)
        write_style(replace(style, curves=curves), robot, command.out)
    _print_times(command.out, style, curves)
    return DID_IT


def extract(command: ExtractStyle) -> int:
    """Extract the style of a motion, a flight log or a clip; write it."""
    robot = load_robot(command)
    with phase("reading"), refusing():
        time, features, scale = _read_source(command, robot)
        begin = -np.inf if command.begin is None else command.begin
        end = np.inf if command.end is None else command.end
        chosen = (time >= begin - 1e-9) & (time <= end + 1e-9)
        if chosen.sum() < 2:
            raise ExtractionError(
                f"{command.source} lasts from {time[0]:.2f} to {time[-1]:.2f} s, expected "
                "--begin and --end within it"
            )
        time, features = time[chosen], features[chosen]
        moving = trim(features)
        first = 0 if command.begin is not None else moving.start
        last = len(time) if command.end is not None else moving.stop
        time, features = time[first:last], features[first:last].copy()
        if command.finish:
            features[-1] = UPRIGHT_STAND
        try:
            curves = extract_curves(time, features)
        except ValueError as error:
            hint = "" if is_stand(features[-1]) else " (--finish lets the last point be a stand)"
            raise BadInputError(f"{command.source}: {error}{hint}") from error
        curves = curves.lasting(curves.duration * scale)
        about = f"from {Path(command.source).name}, {time[0]:.2f} to {time[-1]:.2f} s"
        style = Style(name=command.out.stem, about=about, curves=(curves,))
        write_style(style, robot, command.out)
    _print_times(command.out, None, style.curves)
    return DID_IT


def _edit(curve: StyleCurves, command: EditStyle) -> StyleCurves:
    if command.slower is not None or command.faster is not None:
        factor = command.slower or 1.0 / (command.faster or 1.0)
        curve = curve.lasting(curve.duration * factor)
    if command.sooner is not None or command.later is not None:
        curve = shift_rise(curve, command.later or -(command.sooner or 0.0))
    if command.hold is not None:
        curve = hold(curve, *command.hold)
    return curve


def _read_source(command: ExtractStyle, robot: Robot) -> tuple[Array, Array, float]:
    """Read times [s], features (T, 3), and the factor on durations for this robot."""
    file = Path(command.source)
    kind = file.suffix.lower()
    of_clips = {"--up": command.up, "--rate": command.rate, "--skeleton": command.skeleton}
    used = {BVH: ("--up",), ACCLAIM: tuple(of_clips)}.get(kind, ())
    unused = [name for name, value in of_clips.items() if value is not None and name not in used]
    if unused:
        raise BadInputError(
            f"{unused[0]} is given, expected none with {command.source}: it is of clips "
            f"({ACCLAIM}{f', {BVH}' if unused[0] == '--up' else ''})"
        )
    if kind == LOG:
        return *_read_log(file, robot), 1.0
    if used:
        clip = read_clip(file, command.skeleton, command.rate, command.up)
        scale = float(np.sqrt(leg_length(robot) / clip.leg_length))
        return clip.time, measure_clip(clip), scale
    if kind and kind != MOTION and file.is_file():
        raise BadInputError(
            f"{command.source} is a file of another kind, expected {MOTION}, {LOG}, {BVH}, "
            f"{ACCLAIM}, or the name of a motion"
        )
    motion = find_motion(robot, command.source)
    return motion.time, measure_motion(robot, motion), 1.0


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


def _describe(style: Style) -> dict[str, Any]:
    return {
        "name": style.name,
        "about": style.about,
        "curves": [
            {
                "start": curve.start,
                "duration_s": curve.duration,
                "rise_s": rise_time(curve),
                "neck_height": curve.neck_height,
                "side_deg": np.degrees(curve.side),
                "front_deg": np.degrees(curve.front),
            }
            for curve in style.curves
        ],
    }


def _print_points(row: dict[str, Any]) -> None:
    console = console_for(None)
    console.print(escape(f"{row['name']}: {row['about']}"), soft_wrap=True)
    for curve in row["curves"]:
        heading = f"{curve['duration_s']:.2f} s, rises at {curve['rise_s']:.2f} s"
        heading = f"{curve['start']}, {heading}" if curve["start"] else heading
        table = make_table((heading, *map(str, range(1, 10))), left=(heading,))
        for key, digits in (("neck_height", 2), ("side_deg", 0), ("front_deg", 0)):
            table.add_row(key, *(f"{value:.{digits}f}" for value in curve[key]))
        console.print(table)


def _print_times(file: Path, before: Style | None, curves: tuple[StyleCurves, ...]) -> None:
    """Print duration and time of the rise of each curve, and what they were before."""
    console = console_for(None)
    for number, curve in enumerate(curves):
        name = f"{file}, {curve.start}" if curve.start else str(file)
        text = f"{name}: {curve.duration:.2f} s, rises at {rise_time(curve):.2f} s"
        if before is not None:
            old = before.curves[number]
            text += f"; before: {old.duration:.2f} s, {rise_time(old):.2f} s"
        console.print(escape(text), soft_wrap=True)


def _span(values: list[float]) -> str:
    low, high = min(values), max(values)
    return f"{low:.2f}" if high - low < 0.005 else f"{low:.2f} to {high:.2f}"
