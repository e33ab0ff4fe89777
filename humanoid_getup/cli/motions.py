"""`getup motions list` and `show`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from rich.table import Table

from humanoid_getup.cli.errors import BadInputError, refusing
from humanoid_getup.cli.exit_codes import DID_IT
from humanoid_getup.cli.inputs import find_motion, load_robot
from humanoid_getup.cli.options.motions import ListMotions, ShowMotion
from humanoid_getup.cli.output import (
    console_for,
    find_file_faults,
    phase,
    staging,
    to_json,
    write_json,
)
from humanoid_getup.motions.motion import MIRRORED_SUFFIX, STANDING, Motion
from humanoid_getup.motions.motion_database import load_database
from humanoid_getup.reporting import film_strip
from humanoid_getup.scenes.scene import FLAT_SCENE
from humanoid_getup.simulation.world import World
from robots import Robot
from robots.kinematics import place


def list_motions(command: ListMotions) -> int:
    """Print a table, or JSON."""
    robot = load_robot(command)
    with refusing():
        motions = load_database(robot).motions
    stored = [motion for motion in motions if not motion.name.endswith(MIRRORED_SUFFIX)]
    mirrored = {motion.name for motion in motions} - {motion.name for motion in stored}
    rows = [_describe(m, m.name + MIRRORED_SUFFIX in mirrored) for m in stored]
    write_json(to_json({"robot": robot.name, "motions": rows}), command.json)
    if command.json is None:
        _print(rows)
    return DID_IT


def show(command: ShowMotion) -> int:
    """Draw the postures of a motion, as rolled out when it was built."""
    robot = load_robot(command)
    motion = find_motion(robot, command.motion)
    path = command.picture or Path(f"{motion.name}.png")
    if faults := find_file_faults(path):
        raise BadInputError("; ".join(faults))
    with phase("drawing"):
        try:
            draw_motion(robot, motion, path)
        except film_strip.NoRendererError as error:
            raise BadInputError(f"no film strip: {error}") from error
    console_for(None).print(f"film strip in {path}", markup=False)
    return DID_IT


def draw_motion(robot: Robot, motion: Motion, path: Path) -> None:
    """Draw a motion as a film strip into a PNG file.

    Raises:
        NoRendererError: if there is no OpenGL.
    """
    model = World(robot, FLAT_SCENE).model
    # The frames until the motion stands, or all where that is not known.
    stands = motion.duration if motion.stand_time is None else motion.stand_time
    end = motion.time[0] + stands + film_strip.AFTERMATH
    count = int(np.searchsorted(motion.time, min(end, motion.time[-1]), side="right"))
    rows = film_strip.pick_frames(count)
    qpos = np.array([place(robot, model, motion.posture(int(row))) for row in rows])
    pictures = film_strip.render_frames(robot, model, qpos)
    with staging(path.parent, (path.name,)) as folder:
        times = motion.time[rows] - motion.time[0]
        title = f"{motion.name}: {motion.strategy}"
        film_strip.save_strip(pictures, times, folder / path.name, title=title)


def _describe(motion: Motion, is_mirrored: bool) -> dict[str, Any]:
    made = motion.provenance
    return {
        "name": motion.name,
        "start_class": motion.start_class,
        "end_class": motion.end_class,
        "strategy": motion.strategy,
        "duration_s": motion.duration,
        "stand_time_s": motion.stand_time,
        "robust": made.get("disturbed_success"),
        "torque_limit_nm": made.get("torque_limit"),
        "mirrored": is_mirrored,
    }


def _print(rows: list[dict[str, Any]]) -> None:
    table = Table(box=None, header_style="bold")
    table.add_column("motion", no_wrap=True)
    for heading in ("start", "strategy"):
        table.add_column(heading, no_wrap=True)
    for heading in ("lasts [s]", "stands [s]", "robust", "limit [N·m]", "mirrored"):
        table.add_column(heading, justify="right")
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
    console_for(None).print(table)


def _format(value: Any, form: str) -> str:
    return format(value, form) if isinstance(value, int | float) else "?"
