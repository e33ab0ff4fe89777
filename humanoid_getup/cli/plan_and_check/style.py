"""`getup style`: list, show, edit and extract styles."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
from rich.markup import escape

from humanoid_getup.cli.options.style import EditStyle, ListStyles, ShowStyles
from humanoid_getup.cli.shared.console import console_for, make_table, showing
from humanoid_getup.cli.shared.exit_codes import DID_IT
from humanoid_getup.cli.shared.output import write_json
from humanoid_getup.jobs.errors import refusing
from humanoid_getup.jobs.extract_style import extract_style
from humanoid_getup.jobs.inputs import load_robot
from humanoid_getup.jobs.requests.style import ExtractRequest
from humanoid_getup.reporting.style_plot import save_styles
from humanoid_getup.style.curves import StyleCurves
from humanoid_getup.style.edits import hold, rise_time, shift_rise
from humanoid_getup.style.style import Style
from humanoid_getup.style.style_file import list_styles as list_names
from humanoid_getup.style.style_file import load_style, write_style


class DescribedCurve(msgspec.Struct, frozen=True, kw_only=True):
    """Curves of a style for a way of lying."""

    start: str
    duration: float = msgspec.field(name="duration_s")
    rise: float = msgspec.field(name="rise_s")
    neck_height: tuple[float, ...]
    side_deg: tuple[float, ...]
    front_deg: tuple[float, ...]


class DescribedStyle(msgspec.Struct, frozen=True, kw_only=True):
    """A style, and its curves."""

    name: str
    about: str
    curves: tuple[DescribedCurve, ...]

    @classmethod
    def of(cls, style: Style) -> DescribedStyle:
        """Describe a style."""
        curves = [
            DescribedCurve(
                start=curve.start,
                duration=curve.duration,
                rise=rise_time(curve),
                neck_height=tuple(curve.neck_height),
                side_deg=tuple(np.degrees(curve.side)),
                front_deg=tuple(np.degrees(curve.front)),
            )
            for curve in style.curves
        ]
        return cls(name=style.name, about=style.about, curves=tuple(curves))


def list_styles(command: ListStyles) -> int:
    """Print a table or JSON of the named styles."""
    robot = load_robot(command)
    with refusing():
        rows = [DescribedStyle.of(load_style(name, robot)) for name in list_names()]
    write_json({"robot": robot.name, "styles": rows}, command)
    if command.json is None:
        texts = ("style", "about")
        table = make_table((*texts, "curves", "duration [s]", "rises at [s]"), left=texts)
        for row in rows:
            table.add_row(
                row.name,
                row.about,
                str(len(row.curves)),
                _span([curve.duration for curve in row.curves]),
                _span([curve.rise for curve in row.curves]),
            )
        console_for().print(table)
    return DID_IT


def show(command: ShowStyles) -> int:
    """Print the control points of styles; draw them."""
    robot = load_robot(command)
    with refusing():
        styles = [load_style(name, robot) for name in command.styles]
        if command.picture is not None:
            save_styles(styles, command.picture)
    rows = [DescribedStyle.of(style) for style in styles]
    write_json({"robot": robot.name, "styles": rows}, command)
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


def extract(command: ExtractRequest) -> int:
    """Extract the style of a motion, a flight log or a clip."""
    with showing() as report:
        style = extract_style(command, report)
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


def _print_points(style: DescribedStyle) -> None:
    console = console_for()
    console.print(escape(f"{style.name}: {style.about}"), soft_wrap=True)
    for curve in style.curves:
        heading = f"{curve.duration:.2f} s, rises at {curve.rise:.2f} s"
        heading = f"{curve.start}, {heading}" if curve.start else heading
        table = make_table((heading, *map(str, range(1, 10))), left=(heading,))
        for key, digits in (("neck_height", 2), ("side_deg", 0), ("front_deg", 0)):
            table.add_row(key, *(f"{value:.{digits}f}" for value in getattr(curve, key)))
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
