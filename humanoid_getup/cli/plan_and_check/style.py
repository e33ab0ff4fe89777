"""`getup style`: list, show, edit and extract styles."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rich.markup import escape

from humanoid_getup.commands.console import console_for, do, make_table, showing
from humanoid_getup.commands.exit_codes import DID_IT
from humanoid_getup.commands.output import find_json_target
from humanoid_getup.experiments.starts.falls import CLASSES
from humanoid_getup.jobs.extract_style import extract_style
from humanoid_getup.jobs.requests.style import (
    EditStyleRequest,
    ExtractRequest,
    ListStylesRequest,
    ScenesRequest,
    ShowStylesRequest,
)
from humanoid_getup.jobs.show_scenes import show_scenes
from humanoid_getup.jobs.show_styles import edit_style, show_styles
from humanoid_getup.jobs.show_styles import list_styles as describe_all
from humanoid_getup.style.curves import StyleCurves
from humanoid_getup.style.style import Style
from humanoid_getup.style.style_editor import rise_time


def list_styles(command: ListStylesRequest) -> int:
    """Print a table or JSON of the named styles."""
    found = do(describe_all, command)
    if find_json_target(command) is None:
        texts = ("style", "about")
        table = make_table((*texts, "curves", "duration [s]", "rises at [s]"), left=texts)
        for row in found["styles"]:
            table.add_row(
                row["name"],
                row["about"],
                str(len(row["curves"])),
                _span([curve["duration_s"] for curve in row["curves"]]),
                _span([curve["rise_s"] for curve in row["curves"]]),
            )
        console_for().print(table)
    return DID_IT


def show(command: ShowStylesRequest) -> int:
    """Print the control points of styles; draw them."""
    found = do(show_styles, command)
    for row in found["styles"] if find_json_target(command) is None else ():
        _print_points(row)
    return DID_IT


def edit(command: EditStyleRequest) -> int:
    """Edit all curves of a style; write it."""
    with showing() as report:
        found = edit_style(command, report)
    _print_times(command.out, found.before, found.after.curves)
    return DID_IT


def extract(command: ExtractRequest) -> int:
    """Extract the style of a motion, a flight log or a clip."""
    with showing() as report:
        style = extract_style(command, report)
    _print_times(command.out, None, style.curves)
    return DID_IT


def _print_points(style: dict[str, Any]) -> None:
    console = console_for()
    console.print(escape(f"{style['name']}: {style['about']}"), soft_wrap=True)
    for curve in style["curves"]:
        heading = f"{curve['duration_s']:.2f} s, rises at {curve['rise_s']:.2f} s"
        heading = f"{curve['start']}, {heading}" if curve["start"] else heading
        table = make_table((heading, *map(str, range(1, 10))), left=(heading,))
        for key, digits in (("neck_height", 2), ("side_deg", 0), ("front_deg", 0)):
            table.add_row(key, *(f"{value:.{digits}f}" for value in curve[key]))
        console.print(table)


def _print_times(file: Path, before: Style | None, curves: tuple[StyleCurves, ...]) -> None:
    """Print duration and time of the rise of each curve, now and before."""
    console = console_for()
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


def list_scenes(command: ScenesRequest) -> int:
    """Print a table or JSON of the scenes, and draw one or all if a picture is requested."""
    found = do(show_scenes, command)
    if find_json_target(command) is None:
        _print(found["scenes"])
    return DID_IT


def _print(rows: Sequence[dict[str, Any]]) -> None:
    texts = ("scene", "starts", "about")
    table = make_table((*texts, "obstacles", "friction"), left=texts)
    for row in rows:
        starts = "any" if row["starts"] == tuple(CLASSES) else ", ".join(row["starts"])
        obstacles, friction = str(row["obstacles"]), f"{row['friction']:g}"
        table.add_row(row["name"], starts, row["about"], obstacles, friction)
    console_for().print(table)
