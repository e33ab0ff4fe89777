"""`getup style list` and `show`: the curves of styles of rising."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
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
from humanoid_getup.style.style import SUFFIX, Lying, Style, load_named, load_style, rank_styles
from humanoid_getup.style.style_editor import rise_time
from robots import Robot


@dataclass(frozen=True, kw_only=True)
class ListStylesRequest(BodyOption, RobotOption):
    """List the named styles."""

    start: Annotated[Lying | None, arg(name="from")] = None
    """How the robot lies: what suits it comes first."""


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


@command("style list", json=True)
def list_styles(request: ListStylesRequest, monitor: ProgressMonitor) -> dict[str, Any]:
    """Describe the named styles, those first that suit how a robot lies."""
    robot = load_robot(request)
    monitor.begin("loading")
    styles = load_named(robot)
    if request.start is not None:
        every = [curve for style in styles for curve in style.curves]
        every += [curve.mirrored() for curve in every]
        begin = next(curve.values[0] for curve in every if curve.start == request.start)
        styles = rank_styles(styles, begin)
    return _describe(robot, styles)


@command("style show", json=True)
def show_styles(request: ShowStylesRequest, monitor: ProgressMonitor) -> dict[str, Any]:
    """Describe styles, and draw their curves if a picture is requested."""
    robot = load_robot(request)
    styles = _load(request.styles, robot, monitor)
    if request.picture is not None:
        monitor.begin("drawing")
        save_styles(styles, request.picture)
    return _describe(robot, styles)


def _load(names: Sequence[str], robot: Robot, monitor: ProgressMonitor) -> list[Style]:
    monitor.begin("loading")
    return [load_style(name, robot) for name in names]


def _describe(robot: Robot, styles: Sequence[Style]) -> dict[str, Any]:
    described = [
        {
            "name": style.name,
            "about": style.about,
            "followed_from": style.followed_from,
            "curves": list(map(_list_points, style.curves)),
        }
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


@list_styles.show
def _print_list(found: dict[str, Any], request: ListStylesRequest, console: Console) -> None:
    if find_json_target(request) is not None:
        return
    texts = ("style", "about", "followed from")
    table = make_table((*texts, "duration [s]", "rises at [s]"), left=texts)
    for row in found["styles"]:
        curves = row["curves"]
        spans = (_span([curve[key] for curve in curves]) for key in ("duration_s", "rise_s"))
        starts = ", ".join(row["followed_from"] or ("-",))
        table.add_row(row["name"], row["about"], starts, *spans)
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


def print_times(file: Path, style: Style, console: Console) -> None:
    """Print duration and time of the rise of each curve of a style."""
    for curve in style.curves:
        name = f"{file}, {curve.start}" if curve.start else str(file)
        text = f"{name}: {curve.duration:.2f} s, rises at {rise_time(curve):.2f} s"
        console.print(escape(text), soft_wrap=True)
