"""`getup robots`: which robots are there."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

from rich.table import Table
from tyro.conf import arg

from humanoid_getup.cli.errors import BadInputError, refusing
from humanoid_getup.cli.exit_codes import DID_IT
from humanoid_getup.cli.output import console_for, find_json_faults, to_json, write_json
from humanoid_getup.motions.motion_database import MOTION_FOLDER
from robots import Robot, list_robots, load_robot


@dataclass(frozen=True, kw_only=True)
class ListRobots:
    """List the robots that come with the program."""

    json: Annotated[str | None, arg(metavar="FILE|-")] = None
    """Write the list to a file; - prints it alone on standard output."""

    def run(self) -> int:
        """Print a table, or JSON."""
        if faults := find_json_faults(self.json):
            raise BadInputError("; ".join(faults))
        with refusing():
            rows = [_describe(load_robot(name)) for name in list_robots()]
        write_json(to_json({"robots": rows}), self.json)
        if self.json is None:
            console_for(self.json).print(_tabulate(rows))
        return DID_IT


def _describe(robot: Robot) -> dict[str, Any]:
    model = robot.spec().compile()
    return {
        "name": robot.name,
        "dof": robot.n,
        "mass_kg": float(model.body_subtreemass[robot.layout(model).torso]),
        "neck_height_m": robot.standing_neck_height,
        "motions": len(list((robot.folder / MOTION_FOLDER).glob("*.npz"))),
    }


def _tabulate(rows: list[dict[str, Any]]) -> Table:
    table = Table("robot", box=None, header_style="bold")
    for heading in ("joints", "mass [kg]", "neck height [m]", "motions"):
        table.add_column(heading, justify="right")
    for row in rows:
        mass, height = f"{row['mass_kg']:.2f}", f"{row['neck_height_m']:.3f}"
        table.add_row(row["name"], str(row["dof"]), mass, height, str(row["motions"]))
    return table
