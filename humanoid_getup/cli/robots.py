"""`getup robots`: list the robots that come with the program, import one, check one."""

from __future__ import annotations

import msgspec
import numpy as np
from rich.markup import escape

from humanoid_getup.cli.console import console_for, make_table, showing
from humanoid_getup.cli.exit_codes import DID_IT, DID_NOT_STAND
from humanoid_getup.cli.options.robots import CheckRobot, ListRobots
from humanoid_getup.cli.output import write_json
from humanoid_getup.jobs.check_robot import CheckedRobot
from humanoid_getup.jobs.check_robot import check_robot as check
from humanoid_getup.jobs.errors import BadInputError, refusing
from humanoid_getup.jobs.import_robot import import_robot as make_folder
from humanoid_getup.jobs.requests.robots import ImportRequest
from humanoid_getup.reporting import film_strip
from humanoid_getup.scenes.scene import FLAT_SCENE
from humanoid_getup.simulation.world import World
from robots import Robot, load_robot
from robots import list_robots as list_names
from robots.body.statics import Statics
from robots.kinematics import place

COLORS = {"fault": "red", "warning": "yellow", "ok": "green"}
AZIMUTHS = {"front": 150.0, "side": 90.0}
"""Directions in which the camera looks, from +x [deg]."""


class ListedRobot(msgspec.Struct, frozen=True, kw_only=True):
    """A robot of the list."""

    name: str
    dof: int
    mass: float = msgspec.field(name="mass_kg")
    neck_height: float = msgspec.field(name="neck_height_m")
    motions: int

    @classmethod
    def of(cls, robot: Robot) -> ListedRobot:
        """Describe a robot."""
        model = robot.spec().compile()
        return cls(
            name=robot.name,
            dof=robot.n,
            mass=float(model.body_subtreemass[robot.layout(model).torso]),
            neck_height=robot.standing_neck_height,
            motions=len(list((robot.folder / "motions").glob("*.npz"))),
        )


def list_robots(command: ListRobots) -> int:
    """Print a table, or JSON."""
    with refusing():
        rows = [ListedRobot.of(load_robot(name)) for name in list_names()]
    write_json({"robots": rows}, command)
    if command.json is None:
        headings = ("robot", "joints", "mass [kg]", "neck height [m]", "motions")
        table = make_table(headings, left=("robot",))
        for row in rows:
            figures = (row.dof, f"{row.mass:.2f}", f"{row.neck_height:.3f}", row.motions)
            table.add_row(row.name, *map(str, figures))
        console_for(command).print(table)
    return DID_IT


def import_robot(command: ImportRequest) -> int:
    """Import the model, and report what was found and guessed."""
    with showing(command) as report:
        found = make_folder(command, report)
    write_json(found, command)
    console = console_for(command)
    console.print(
        f"{found.name}: {found.dof} joints, {found.mass:.2f} kg, torso '{found.torso}', servos "
        f"{', '.join(found.servos)} at {found.supply_voltage:g} V",
        markup=False,
    )
    for title, lines in (("note", found.notes), ("guessed", found.guesses)):
        for line in lines:
            console.print(f"{title}: {line}", markup=False)
    console.print(f"written to {command.out}; next: getup robots check {command.out}", markup=False)
    return DID_IT


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
        console.print(f"not checked before the faults are mended: {', '.join(unchecked)}")
    if command.picture is not None:
        _draw(found, command)
        console.print(f"picture in {command.picture}", markup=False, soft_wrap=True)
    return DID_IT if found.is_sound else DID_NOT_STAND


def _draw(found: CheckedRobot, command: CheckRobot) -> None:
    """Draw the stance from the front and the side, and the deepest squat beside it."""
    assert command.picture is not None
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
    film_strip.save_sheet(np.array(pictures), captions, command.picture, title=robot.name)
