"""`getup motions list` and `show`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from humanoid_getup.cli.options.motions import ListMotions, ShowMotion
from humanoid_getup.commands.console import console_for, make_table, phase
from humanoid_getup.commands.errors import BadInputError, refusing
from humanoid_getup.commands.exit_codes import DID_IT
from humanoid_getup.commands.inputs import find_motion, load_robot
from humanoid_getup.commands.output import write_json
from humanoid_getup.commands.output_files import find_file_problems
from humanoid_getup.motions.motion import MIRRORED_SUFFIX, STANDING, Motion
from humanoid_getup.motions.motion_database import load_database
from humanoid_getup.reporting import film_strip
from humanoid_getup.reporting.motion_strip import draw_motion


def _describe(motion: Motion, *, mirrored: bool) -> dict[str, Any]:
    return {
        "name": motion.name,
        "start_class": motion.start_class,
        "end_class": motion.end_class,
        "strategy": motion.strategy,
        "duration_s": motion.duration,
        "stand_time_s": motion.stand_time,
        "robust": motion.provenance.get("disturbed_success"),
        "torque_limit_nm": motion.provenance.get("torque_limit"),
        "mirrored": mirrored,
    }


def list_motions(command: ListMotions) -> int:
    """Print a table, or JSON."""
    robot = load_robot(command)
    with refusing():
        names = {motion.name: motion for motion in load_database(robot).motions}
    rows = [
        _describe(motion, mirrored=name + MIRRORED_SUFFIX in names)
        for name, motion in names.items()
        if not name.endswith(MIRRORED_SUFFIX)
    ]
    write_json({"robot": robot.name, "motions": rows}, command)
    if command.json is None:
        _print(rows)
    return DID_IT


def _print(rows: list[dict[str, Any]]) -> None:
    texts = ("motion", "start", "strategy")
    figures = ("lasts [s]", "stands [s]", "robust", "limit [N·m]", "mirrored")
    table = make_table((*texts, *figures), left=texts)
    for column in table.columns[:3]:
        column.no_wrap = True
    for row in rows:
        table.add_row(
            row["name"],
            row["start_class"],
            row["strategy"],
            f"{row['duration_s']:.2f}",
            _format(row["stand_time_s"], ".2f") if row["end_class"] == STANDING else "",
            _format(row["robust"], ".0%"),
            _format(row["torque_limit_nm"], ".1f"),
            "yes" if row["mirrored"] else "",
        )
    console_for().print(table)


def _format(value: object, form: str) -> str:
    return format(value, form) if isinstance(value, int | float) else "?"


def show(command: ShowMotion) -> int:
    """Draw the postures of a motion, as rolled out when it was built."""
    robot = load_robot(command)
    motion = find_motion(robot, command.motion)
    path = command.picture or Path(f"{motion.name}.png")
    if problems := find_file_problems(path):
        raise BadInputError("; ".join(problems))
    with phase("drawing"):
        try:
            draw_motion(robot, motion, path)
        except film_strip.NoRendererError as error:
            raise BadInputError(f"no film strip: {error}") from error
    console_for().print(f"film strip in {path}", markup=False)
    return DID_IT
