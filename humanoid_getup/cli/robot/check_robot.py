"""`getup robots check`: checks a robot's description and abilities."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from rich.markup import escape

from humanoid_getup.cli.options.hardware import CheckRobot
from humanoid_getup.commands.console import console_for, showing
from humanoid_getup.commands.errors import BadInputError
from humanoid_getup.commands.exit_codes import DID_IT, DID_NOT_STAND
from humanoid_getup.commands.output import write_json
from humanoid_getup.jobs.robots import CheckedRobot
from humanoid_getup.jobs.robots import check_robot as check
from humanoid_getup.reporting import film_strip
from humanoid_getup.scenes.scene import FLAT_SCENE
from humanoid_getup.simulation.world import World
from robots.body.statics import Statics
from robots.kinematics import place

COLORS = {"fault": "red", "warning": "yellow", "ok": "green"}
AZIMUTHS = {"front": 150.0, "side": 90.0}
"""Directions in which the camera looks, from +x [deg]."""


def check_robot(command: CheckRobot) -> int:
    """Print one finding a line, and draw the stance and the deepest squat."""
    with showing(command) as report:
        found = check(command, report)
    unchecked = found.check.unchecked
    summary = {"robot": found.robot.name, "findings": found.findings, "unchecked": unchecked}
    write_json(summary, command)
    console = console_for(command)
    for finding in found.findings:
        color = COLORS[finding.level]
        console.print(f"[{color}]{finding.level:7}[/] {escape(str(finding))}", soft_wrap=True)
    if unchecked:
        console.print(f"not checked until the faults are corrected: {', '.join(unchecked)}")
    if command.picture is not None:
        _draw(found, command.picture)
        console.print(f"picture in {command.picture}", markup=False, soft_wrap=True)
    return DID_IT if found.is_sound else DID_NOT_STAND


def _draw(found: CheckedRobot, picture: Path) -> None:
    """Draw the stance from the front and the side, and the deepest squat beside it."""
    robot = found.robot
    model = World(robot, FLAT_SCENE).model
    postures = {"stance": robot.standing}
    if found.check.squats:
        deepest = min(found.check.squats, key=lambda squat: squat.neck_share)
        postures["deepest squat"] = Statics(robot).make_posture(deepest.joint_pos)
    pictures, captions = [], []
    try:
        for name, posture in postures.items():
            qpos = place(robot, model, posture)[None]
            for view, azimuth in AZIMUTHS.items():
                pictures.append(film_strip.render_frames(robot, model, qpos, azimuth=azimuth)[0])
                captions.append(f"{name}, {view}")
    except film_strip.NoRendererError as error:
        raise BadInputError(f"no picture: {error}") from error
    film_strip.save_sheet(np.array(pictures), captions, picture, title=robot.name)
