"""`getup robots list`: the robots that come with the program."""

from __future__ import annotations

from dataclasses import dataclass

import msgspec

from humanoid_getup.commands.command import program, write_json
from humanoid_getup.commands.console import console_for, make_table
from humanoid_getup.commands.errors import DID_IT
from humanoid_getup.commands.options import JsonOption
from humanoid_getup.motions.motion_database import list_motions
from robots import Robot, load_robot
from robots import list_robots as list_names

HEADINGS = ("robot", "joints", "mass [kg]", "neck height [m]", "motions")


@dataclass(frozen=True, kw_only=True)
class ListRobots(JsonOption):
    """List the robots that come with the program."""


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
            motions=len(list_motions(robot)),
        )


@program("robots list")
def list_robots(options: ListRobots) -> int:
    """Print a table, or JSON."""
    rows = [ListedRobot.of(load_robot(name)) for name in list_names()]
    write_json({"robots": rows}, options)
    if options.json is None:
        table = make_table(HEADINGS, left=("robot",))
        for row in rows:
            figures = (row.dof, f"{row.mass:.2f}", f"{row.neck_height:.3f}", row.motions)
            table.add_row(row.name, *map(str, figures))
        console_for(options).print(table)
    return DID_IT
