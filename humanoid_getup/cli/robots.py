"""`getup robots`: list the robots that come with the program."""

from __future__ import annotations

from typing import Any

from rich.table import Table

from humanoid_getup.cli.errors import refusing
from humanoid_getup.cli.exit_codes import DID_IT
from humanoid_getup.cli.options.motions import ListRobots
from humanoid_getup.cli.output import console_for, to_json, write_json
from robots import Robot, load_robot
from robots import list_robots as list_names


def list_robots(command: ListRobots) -> int:
    """Print a table, or JSON."""
    with refusing():
        rows = [_describe(load_robot(name)) for name in list_names()]
    write_json(to_json({"robots": rows}), command.json)
    if command.json is None:
        _print(rows)
    return DID_IT


def _describe(robot: Robot) -> dict[str, Any]:
    model = robot.spec().compile()
    return {
        "name": robot.name,
        "dof": robot.n,
        "mass_kg": float(model.body_subtreemass[robot.layout(model).torso]),
        "neck_height_m": robot.standing_neck_height,
        "motions": len(list((robot.folder / "motions").glob("*.npz"))),
    }


def _print(rows: list[dict[str, Any]]) -> None:
    table = Table("robot", box=None, header_style="bold")
    for heading in ("joints", "mass [kg]", "neck height [m]", "motions"):
        table.add_column(heading, justify="right")
    for row in rows:
        mass, height = f"{row['mass_kg']:.2f}", f"{row['neck_height_m']:.3f}"
        table.add_row(row["name"], str(row["dof"]), mass, height, str(row["motions"]))
    console_for(None).print(table)
