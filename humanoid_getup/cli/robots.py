"""`getup robots`: list the robots that come with the program."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from humanoid_getup.cli.errors import BadInputError, refusing
from humanoid_getup.cli.exit_codes import DID_IT
from humanoid_getup.cli.options import JsonTarget
from humanoid_getup.cli.output import console_for, find_json_faults, to_json, write_json

if TYPE_CHECKING:
    from robots import Robot


@dataclass(frozen=True, kw_only=True)
class ListRobots:
    """List the robots that come with the program."""

    json: JsonTarget = None

    def run(self) -> int:
        """Print a table, or JSON."""
        if faults := find_json_faults(self.json):
            raise BadInputError("; ".join(faults))
        from robots import list_robots, load_robot

        with refusing():
            rows = [_describe(load_robot(name)) for name in list_robots()]
        write_json(to_json({"robots": rows}), self.json)
        if self.json is None:
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
    from rich.table import Table

    table = Table("robot", box=None, header_style="bold")
    for heading in ("joints", "mass [kg]", "neck height [m]", "motions"):
        table.add_column(heading, justify="right")
    for row in rows:
        mass, height = f"{row['mass_kg']:.2f}", f"{row['neck_height_m']:.3f}"
        table.add_row(row["name"], str(row["dof"]), mass, height, str(row["motions"]))
    console_for(None).print(table)
