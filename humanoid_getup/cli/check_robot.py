"""`getup robots check`: what is wrong with a robot's description, and what its body can do."""

from __future__ import annotations

from dataclasses import asdict

import numpy as np
from rich.markup import escape

from humanoid_getup.cli.errors import BadInputError
from humanoid_getup.cli.exit_codes import DID_IT, DID_NOT_STAND
from humanoid_getup.cli.options.robots import CheckRobot
from humanoid_getup.cli.output import console_for, phase, to_json, write_json
from humanoid_getup.reporting import film_strip
from humanoid_getup.robot_check.check import RobotCheck
from humanoid_getup.robot_check.check import check_robot as check
from humanoid_getup.scenes.scene import FLAT_SCENE
from humanoid_getup.simulation.world import World
from robots import Robot, RobotError, load_robot
from robots.body.statics import Statics
from robots.kinematics import place

COLORS = {"fault": "red", "warning": "yellow", "ok": "green"}
AZIMUTHS = {"front": 150.0, "side": 90.0}
"""Directions in which the camera looks, from +x [deg]."""


def check_robot(command: CheckRobot) -> int:
    """Print one finding a line, and draw the stance and the deepest squat."""
    try:
        robot = load_robot(command.robot)
    except RobotError as error:
        raise BadInputError(*error.problems) from error
    with phase("checking"):
        try:
            found = check(robot)
        except ValueError as error:
            raise BadInputError(str(error)) from error
    rows = [asdict(finding) for finding in found.findings]
    summary = {"robot": robot.name, "findings": rows, "unchecked": list(found.unchecked)}
    write_json(to_json(summary), command.json)
    console = console_for(command.json)
    for finding in found.findings:
        color = COLORS[finding.level]
        console.print(f"[{color}]{finding.level:7}[/] {escape(str(finding))}", soft_wrap=True)
    if found.unchecked:
        console.print(f"not checked before the faults are mended: {', '.join(found.unchecked)}")
    if command.picture is not None:
        _draw(robot, found, command)
        console.print(f"picture in {command.picture}", markup=False, soft_wrap=True)
    return DID_IT if found.is_sound else DID_NOT_STAND


def _draw(robot: Robot, found: RobotCheck, command: CheckRobot) -> None:
    """Draw the stance from the front and the side, and the deepest squat beside it."""
    assert command.picture is not None
    model = World(robot, FLAT_SCENE).model
    postures = {"stance": robot.standing}
    if found.squats:
        deepest = min(found.squats, key=lambda squat: squat.neck_share)
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
    film_strip.save_sheet(np.array(pictures), captions, command.picture, title=robot.name)
