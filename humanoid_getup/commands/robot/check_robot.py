"""`getup robots check`: a robot's description and abilities."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
from rich.console import Console
from rich.markup import escape
from tyro.conf import Positional, arg

from humanoid_getup.commands.command import command
from humanoid_getup.commands.errors import DID_IT, DID_NOT_STAND
from humanoid_getup.commands.files import ROBOT
from humanoid_getup.commands.options import PictureOption
from humanoid_getup.progress.callback import ProgressMonitor
from humanoid_getup.reporting import film_strip
from humanoid_getup.robot_check import check as checking
from humanoid_getup.robot_check.check import RobotCheck
from humanoid_getup.scenes.scene import FLAT_SCENE
from humanoid_getup.simulation.world import World
from robots import load_robot
from robots.body.statics import Statics
from robots.kinematics import place

COLORS = {"fault": "red", "warning": "yellow", "ok": "green"}
AZIMUTHS = {"front": 150.0, "side": 90.0}
"""Directions in which the camera looks, from +x [deg]."""


@dataclass(frozen=True, kw_only=True)
class CheckRequest(PictureOption):
    """Check whether a robot's description is sound and its body able to get up; one finding a
    line, each with what to do. The picture is of the stance and of the deepest squat."""

    robot: Annotated[Positional[str], ROBOT, arg(metavar="NAME|DIR")]
    """Name of a robot, or a folder with a robot.toml."""


@command("robots check", json=RobotCheck.describe)
def check_robot(request: CheckRequest, monitor: ProgressMonitor) -> RobotCheck:
    """Check whether a robot's description is sound and its body able to get up."""
    robot = load_robot(request.robot)
    check = checking.check_robot(robot, lambda part: monitor.begin(f"checking {part}"))
    if request.picture is not None:
        _draw(check, request.picture)
    return check


@check_robot.show
def _print(found: RobotCheck, request: CheckRequest, console: Console) -> int:
    for finding in found.findings:
        color = COLORS[finding.level]
        console.print(f"[{color}]{finding.level:7}[/] {escape(str(finding))}", soft_wrap=True)
    if unchecked := found.unchecked:
        console.print(f"not checked until the faults are corrected: {', '.join(unchecked)}")
    if request.picture is not None:
        console.print(f"picture in {request.picture}", markup=False, soft_wrap=True)
    return DID_IT if found.is_sound else DID_NOT_STAND


def _draw(check: RobotCheck, picture: Path) -> None:
    """Draw the stance from the front and the side, and the deepest squat beside it."""
    robot, model = check.robot, World(check.robot, FLAT_SCENE).model
    postures = {"stance": robot.standing}
    if check.squats:
        deepest = min(check.squats, key=lambda squat: squat.neck_share)
        postures["deepest squat"] = Statics(robot).make_posture(deepest.joint_pos)
    pictures, captions = [], []
    try:
        for name, posture in postures.items():
            qpos = place(robot, model, posture)[None]
            for view, azimuth in AZIMUTHS.items():
                pictures.append(film_strip.render_frames(robot, model, qpos, azimuth=azimuth)[0])
                captions.append(f"{name}, {view}")
    except film_strip.NoRendererError as error:
        raise ValueError(f"no picture: {error}") from error
    film_strip.save_sheet(np.array(pictures), captions, picture, title=robot.name)
