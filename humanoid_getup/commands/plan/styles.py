"""`getup style list`, `show` and `edit`: the curves of styles of rising."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from rich.console import Console
from rich.markup import escape
from tyro.conf import Positional, arg

from humanoid_getup.commands.command import command
from humanoid_getup.commands.console import find_json_target, make_table
from humanoid_getup.commands.files import READ, WRITTEN
from humanoid_getup.commands.inputs import load_robot
from humanoid_getup.commands.options import BodyOption, RobotOption
from humanoid_getup.progress.callback import ProgressMonitor
from humanoid_getup.reporting.plots import save_styles
from humanoid_getup.style.curves import StyleCurves
from humanoid_getup.style.style import SUFFIX, Style, load_style, write_style
from humanoid_getup.style.style import list_styles as list_names
from humanoid_getup.style.style_editor import hold, rise_time, shift_rise
from robots import Robot
from robots.storage.validation import between

Factor = Annotated[float | None, between(1e-4, 1e4), arg(metavar="FACTOR")]
Shift = Annotated[float | None, between(0.001, 1000.0, "s"), arg(metavar="S")]


@dataclass(frozen=True, kw_only=True)
class ListStylesRequest(BodyOption, RobotOption):
    """List the named styles."""


@dataclass(frozen=True, kw_only=True)
class ShowStylesRequest(BodyOption, RobotOption):
    """Print the control points of styles, and draw their curves."""

    styles: Annotated[Positional[tuple[str, ...]], READ, arg(metavar="STYLE...")]
    """Names of styles, or style files."""
    picture: Annotated[Path | None, WRITTEN, arg(metavar="FILE.png")] = None
    """Picture of the curves to write: each style's mean, and the spread over ways of lying."""

    def _find_problems(self) -> Iterator[str]:
        yield from super()._find_problems()
        if not self.styles:
            yield "there is no STYLE, expected one or more names or files"


@dataclass(frozen=True, kw_only=True)
class StyleOutput(BodyOption, RobotOption):
    """Output file of a style."""

    out: Annotated[Path, WRITTEN, arg(metavar="FILE.toml")]
    """Style file to write; an existing file is replaced."""

    def _find_problems(self) -> Iterator[str]:
        yield from super()._find_problems()
        if self.out.suffix != SUFFIX:
            yield f"--out is {self.out}, expected a name that ends with {SUFFIX}"


@dataclass(frozen=True, kw_only=True)
class EditStyleRequest(StyleOutput):
    """Edit a style: its duration first, then the time of the rise, then a hold."""

    style: Annotated[
        Positional[str],
        READ,
        arg(metavar="STYLE", help="Name of a style, see `getup style list`, or a style file."),
    ]
    slower: Factor = None
    """Factor on the duration."""
    faster: Factor = None
    """Divisor of the duration."""
    sooner: Shift = None
    """Time by which the neck rises sooner [s]; the duration stays."""
    later: Shift = None
    """Time by which the neck rises later [s]; the duration stays."""
    hold: Annotated[tuple[float, float] | None, arg(metavar="AT,S")] = None
    """Time whose targets are held [s], and duration of the hold [s]."""

    def _find_problems(self) -> Iterator[str]:
        yield from super()._find_problems()
        for one, other in (("slower", "faster"), ("sooner", "later")):
            if getattr(self, one) is not None and getattr(self, other) is not None:
                yield f"--{one} and --{other} are given, expected one of them"
        at, lasting = self.hold or (0.0, 1.0)
        if not (0.0 <= at < math.inf and 0.0 < lasting < math.inf):
            yield (
                f"--hold is {at:g},{lasting:g}, expected a time from 0 s and a duration above 0 s"
            )
        edits = (self.slower, self.faster, self.sooner, self.later, self.hold)
        if all(edit is None for edit in edits):
            yield ("no edit is given, expected --slower, --faster, --sooner, --later, --hold")


@dataclass(frozen=True, kw_only=True, eq=False)
class EditedStyle:
    """A style before and after its edits."""

    before: Style
    after: Style


@command("style list", json=True)
def list_styles(request: ListStylesRequest, monitor: ProgressMonitor) -> dict[str, Any]:
    """Describe the named styles."""
    robot = load_robot(request)
    return _describe(robot, _load(list_names(), robot, monitor))


@command("style show", json=True)
def show_styles(request: ShowStylesRequest, monitor: ProgressMonitor) -> dict[str, Any]:
    """Describe styles, and draw their curves if a picture is requested."""
    robot = load_robot(request)
    styles = _load(request.styles, robot, monitor)
    if request.picture is not None:
        monitor.begin("drawing")
        save_styles(styles, request.picture)
    return _describe(robot, styles)


@command("style edit")
def edit_style(request: EditStyleRequest, monitor: ProgressMonitor) -> EditedStyle:
    """Edit all curves of a style, and write it."""
    robot = load_robot(request)
    (style,) = _load([request.style], robot, monitor)
    edited = replace(style, curves=tuple(_edit(curve, request) for curve in style.curves))
    monitor.check()
    write_style(edited, robot, request.out)
    return EditedStyle(before=style, after=edited)


def _load(names: Sequence[str], robot: Robot, monitor: ProgressMonitor) -> list[Style]:
    monitor.begin("loading")
    return [load_style(name, robot) for name in names]


def _describe(robot: Robot, styles: Sequence[Style]) -> dict[str, Any]:
    described = [
        {"name": style.name, "about": style.about, "curves": list(map(_list_points, style.curves))}
        for style in styles
    ]
    return {"robot": robot.name, "styles": described}


def _list_points(curve: StyleCurves) -> dict[str, Any]:
    return {
        "start": curve.start,
        "duration_s": curve.duration,
        "rise_s": rise_time(curve),
        "neck_height": tuple(curve.neck_height),
        "side_deg": tuple(np.degrees(curve.side)),
        "front_deg": tuple(np.degrees(curve.front)),
    }


def _edit(curve: StyleCurves, request: EditStyleRequest) -> StyleCurves:
    if request.slower is not None or request.faster is not None:
        factor = request.slower or 1.0 / (request.faster or 1.0)
        curve = curve.lasting(curve.duration * factor)
    if request.sooner is not None or request.later is not None:
        curve = shift_rise(curve, request.later or -(request.sooner or 0.0))
    if request.hold is not None:
        curve = hold(curve, *request.hold)
    return curve


@list_styles.show
def _print_list(found: dict[str, Any], request: ListStylesRequest, console: Console) -> None:
    if find_json_target(request) is not None:
        return
    texts = ("style", "about")
    table = make_table((*texts, "curves", "duration [s]", "rises at [s]"), left=texts)
    for row in found["styles"]:
        curves = row["curves"]
        spans = (_span([curve[key] for curve in curves]) for key in ("duration_s", "rise_s"))
        table.add_row(row["name"], row["about"], str(len(curves)), *spans)
    console.print(table)


def _span(values: list[float]) -> str:
    low, high = min(values), max(values)
    return f"{low:.2f}" if high - low < 0.005 else f"{low:.2f} to {high:.2f}"


@show_styles.show
def _print_points(found: dict[str, Any], request: ShowStylesRequest, console: Console) -> None:
    for style in found["styles"] if find_json_target(request) is None else ():
        console.print(escape(f"{style['name']}: {style['about']}"), soft_wrap=True)
        for curve in style["curves"]:
            heading = f"{curve['duration_s']:.2f} s, rises at {curve['rise_s']:.2f} s"
            heading = f"{curve['start']}, {heading}" if curve["start"] else heading
            table = make_table((heading, *map(str, range(1, 10))), left=(heading,))
            for key, digits in (("neck_height", 2), ("side_deg", 0), ("front_deg", 0)):
                table.add_row(key, *(f"{value:.{digits}f}" for value in curve[key]))
            console.print(table)


@edit_style.show
def _print_edited(found: EditedStyle, request: EditStyleRequest, console: Console) -> None:
    print_times(request.out, found.after, console, before=found.before)


def print_times(file: Path, style: Style, console: Console, before: Style | None = None) -> None:
    """Print duration and time of the rise of each curve of a style, now and before."""
    for number, curve in enumerate(style.curves):
        name = f"{file}, {curve.start}" if curve.start else str(file)
        text = f"{name}: {curve.duration:.2f} s, rises at {rise_time(curve):.2f} s"
        if before is not None:
            old = before.curves[number]
            text += f"; before: {old.duration:.2f} s, {rise_time(old):.2f} s"
        console.print(escape(text), soft_wrap=True)
