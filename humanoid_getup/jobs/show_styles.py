"""Lists, shows and edits styles of rising."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from humanoid_getup.commands.errors import refusing
from humanoid_getup.commands.inputs import load_robot
from humanoid_getup.jobs.requests.style import (
    EditStyleRequest,
    ListStylesRequest,
    ShowStylesRequest,
)
from humanoid_getup.progress.callback import Cancel, ProgressMonitor, Report
from humanoid_getup.reporting.style_plot import save_styles
from humanoid_getup.style.curves import StyleCurves
from humanoid_getup.style.style import Style
from humanoid_getup.style.style_editor import hold, rise_time, shift_rise
from humanoid_getup.style.style_file import list_styles as list_names
from humanoid_getup.style.style_file import load_style, write_style
from robots import Robot


@dataclass(frozen=True, kw_only=True, eq=False)
class EditedStyle:
    """A style before and after its edits."""

    before: Style
    after: Style


def list_styles(
    request: ListStylesRequest, report: Report | None = None, cancel: Cancel | None = None
) -> dict[str, Any]:
    """Describe the named styles."""
    ListStylesRequest.accept(request)
    robot, monitor = load_robot(request), ProgressMonitor(report, cancel)
    return _describe(robot, _load(list_names(), robot, monitor))


def show_styles(
    request: ShowStylesRequest, report: Report | None = None, cancel: Cancel | None = None
) -> dict[str, Any]:
    """Describe styles, and draw their curves if a picture is requested."""
    ShowStylesRequest.accept(request)
    robot, monitor = load_robot(request), ProgressMonitor(report, cancel)
    styles = _load(request.styles, robot, monitor)
    if request.picture is not None:
        monitor.begin("drawing")
        with refusing():
            save_styles(styles, request.picture)
    return _describe(robot, styles)


def edit_style(
    request: EditStyleRequest, report: Report | None = None, cancel: Cancel | None = None
) -> EditedStyle:
    """Edit all curves of a style, and write it."""
    EditStyleRequest.accept(request)
    robot, monitor = load_robot(request), ProgressMonitor(report, cancel)
    (style,) = _load([request.style], robot, monitor)
    with refusing():
        edited = replace(style, curves=tuple(_edit(curve, request) for curve in style.curves))
        monitor.check()
        write_style(edited, robot, request.out)
    return EditedStyle(before=style, after=edited)


def _load(names: Sequence[str], robot: Robot, monitor: ProgressMonitor) -> list[Style]:
    monitor.begin("loading")
    with refusing():
        return [load_style(name, robot) for name in names]


def _describe(robot: Robot, styles: Sequence[Style]) -> dict[str, Any]:
    curves = [
        [
            {
                "start": curve.start,
                "duration_s": curve.duration,
                "rise_s": rise_time(curve),
                "neck_height": tuple(curve.neck_height),
                "side_deg": tuple(np.degrees(curve.side)),
                "front_deg": tuple(np.degrees(curve.front)),
            }
            for curve in style.curves
        ]
        for style in styles
    ]
    described = [
        {"name": style.name, "about": style.about, "curves": rows}
        for style, rows in zip(styles, curves, strict=True)
    ]
    return {"robot": robot.name, "styles": described}


def _edit(curve: StyleCurves, request: EditStyleRequest) -> StyleCurves:
    if request.slower is not None or request.faster is not None:
        factor = request.slower or 1.0 / (request.faster or 1.0)
        curve = curve.lasting(curve.duration * factor)
    if request.sooner is not None or request.later is not None:
        curve = shift_rise(curve, request.later or -(request.sooner or 0.0))
    if request.hold is not None:
        curve = hold(curve, *request.hold)
    return curve
