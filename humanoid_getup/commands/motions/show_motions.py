"""`getup motions list` and `show`: a robot's motions as a table, one as a film strip."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from rich.console import Console
from tyro.conf import Positional, arg

from humanoid_getup.commands.command import command
from humanoid_getup.commands.console import find_json_target, make_table
from humanoid_getup.commands.errors import BadInputError
from humanoid_getup.commands.files import PICTURE, check_file
from humanoid_getup.commands.inputs import find_motion, load_robot
from humanoid_getup.commands.options import BodyOption, MotionName, RobotOption
from humanoid_getup.motions.motion import MIRRORED_SUFFIX, STANDING
from humanoid_getup.motions.motion_database import load_database
from humanoid_getup.progress.callback import ProgressMonitor
from humanoid_getup.reporting.film_strip import NoRendererError, draw_motion


@dataclass(frozen=True, kw_only=True)
class ListMotionsRequest(BodyOption, RobotOption):
    """List a robot's rising motions."""


@dataclass(frozen=True, kw_only=True)
class ShowMotionRequest(BodyOption, RobotOption):
    """Draw a rising motion as a film strip."""

    motion: Positional[MotionName]
    picture: Annotated[Path | None, PICTURE, arg(metavar="FILE.png")] = None
    """Picture to write; default: MOTION.png."""


@command("motions list", json=True)
def list_motions(request: ListMotionsRequest, _: ProgressMonitor) -> dict[str, Any]:
    """Describe a robot's motions; mirror images are noted with what they mirror."""
    robot = load_robot(request)
    motions = {motion.name: motion for motion in load_database(robot).motions}
    rows = [
        {
            "name": name,
            "start_class": motion.start_class,
            "end_class": motion.end_class,
            "strategy": motion.strategy,
            "duration_s": motion.duration,
            "stand_time_s": motion.stand_time,
            "robust": motion.provenance.get("disturbed_success"),
            "torque_limit_nm": motion.provenance.get("torque_limit"),
            "mirrored": name + MIRRORED_SUFFIX in motions,
        }
        for name, motion in motions.items()
        if not name.endswith(MIRRORED_SUFFIX)
    ]
    return {"robot": robot.name, "motions": rows}


@list_motions.show
def _print_list(found: dict[str, Any], request: ListMotionsRequest, console: Console) -> None:
    if find_json_target(request) is not None:
        return
    texts = ("motion", "start", "strategy")
    figures = ("lasts [s]", "stands [s]", "robust", "limit [N·m]", "mirrored")
    table = make_table((*texts, *figures), left=texts)
    for column in table.columns[:3]:
        column.no_wrap = True
    for row in found["motions"]:
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
    console.print(table)


def _format(value: object, form: str) -> str:
    return format(value, form) if isinstance(value, int | float) else "?"


@command("motions show")
def show_motion(request: ShowMotionRequest, monitor: ProgressMonitor) -> Path:
    """Draw the postures of a motion, as rolled out when it was built; return the picture."""
    robot = load_robot(request)
    motion = find_motion(robot, request.motion)
    picture = request.picture or Path(f"{motion.name}.png")
    check_file(picture)
    monitor.begin("drawing")
    try:
        draw_motion(robot, motion, picture)
    except NoRendererError as error:
        raise BadInputError(f"no film strip: {error}") from error
    return picture


@show_motion.show
def _print_picture(picture: Path, _: ShowMotionRequest, console: Console) -> None:
    console.print(f"film strip in {picture}", markup=False)
