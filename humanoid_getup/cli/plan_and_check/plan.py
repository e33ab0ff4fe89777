"""`getup plan`: plans a path without physics, and prints figures of the search."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from rich.markup import escape
from rich.table import Table

from humanoid_getup.cli.options.motions import PATH, PLAN_FILES, STRIP, Plan
from humanoid_getup.commands.console import console_for, phase, showing
from humanoid_getup.commands.exit_codes import DID_IT, NO_PATH
from humanoid_getup.commands.output import write_json
from humanoid_getup.commands.output_files import staging
from humanoid_getup.jobs.plan_path import PlannedPath
from humanoid_getup.jobs.plan_path import plan as search
from humanoid_getup.motions.motion import Trajectory
from humanoid_getup.motions.posture_metric import PostureMetric
from humanoid_getup.planning.path_query import (
    PathAnswer,
    measure_length,
    to_motion,
)
from humanoid_getup.planning.rrt_blossom import SearchStatus
from humanoid_getup.reporting import film_strip
from humanoid_getup.simulation.world import World
from robots.kinematics import place_postures


def plan(command: Plan) -> int:
    """Plan a path, and write it with a film strip and its figures; return the exit code."""
    with showing(command) as report:
        found = search(command, report)
    answer, world = found.answer, found.world
    if command.out is None:
        record = _describe(found, command, None)
        write_json(record, command)
        _print(record, [], command)
        return DID_IT if found.found else NO_PATH
    with phase("drawing"), staging(command.out, PLAN_FILES) as folder:
        no_strip = _write(answer, world, command, folder)
        written = [str(command.out / name) for name in PLAN_FILES if (folder / name).exists()]
        record = _describe(found, command, no_strip)
        write_json(record, command)
    _print(record, written, command)
    return DID_IT if found.found else NO_PATH


def _write(answer: PathAnswer, world: World, command: Plan, folder: Path) -> str | None:
    """Write the path and its film strip; return why there is no strip."""
    path = answer.path if answer.found or command.keep_partial else None
    if path is None:
        return "there is no path"
    to_motion(world, path, answer, command.seed).save(folder / PATH)
    return _draw(path, world, folder / STRIP, answer.goal.name)


def _draw(path: Trajectory, world: World, file: Path, goal: str) -> str | None:
    """Draw a path as a film strip; return why there is none."""
    rows = film_strip.pick_frames(len(path.time))
    qpos = place_postures(
        world.robot,
        world.model,
        path.position[rows],
        path.orientation[rows],
        path.joint_pos[rows],
    )
    try:
        pictures = film_strip.render_frames(world.robot, world.model, qpos)
    except film_strip.NoRendererError as error:
        return str(error)
    title = f"{world.robot.name}, {world.scene.name}: path to {goal}, no physics"
    film_strip.save_strip(pictures, path.time[rows], file, title=title)
    return None


def _describe(found: PlannedPath, command: Plan, no_strip: str | None) -> dict[str, Any]:
    """Describe a search; ``no_strip`` says why there is no film strip."""
    answer, world = found.answer, found.world
    result, path, joined = answer.result, answer.path, answer.goal.connection
    return {
        "robot": world.robot.name,
        "scene": command.scene,
        "seed": command.seed,
        "start": command.origin,
        "start_class": found.start.start_class,
        "found": answer.found,
        "goal": answer.goal.name,
        "connection": joined
        and {
            "motion": joined.motion.name,
            "frame": joined.frame,
            "time_s": float(joined.motion.time[joined.frame] - joined.motion.time[0]),
            "distance": joined.distance,
        },
        "status": result.status.value,
        "reason": result.reason,
        "leg": result.leg,
        "refined": result.refined,
        "way_out_m": answer.way_out and answer.way_out.length,
        "checks": answer.checks,
        "nodes": answer.nodes,
        "time_s": answer.time,
        "duration_s": None if path is None else float(path.time[-1]),
        "length": None if path is None else measure_length(PostureMetric.of(world.robot), path),
        "tried": [{"goal": goal, "reason": reason} for goal, reason in answer.tried],
        "strip_reason": no_strip,
        "keys": [
            {"name": key.name, "time_s": time}
            for key, time in zip(found.keys, found.key_times, strict=True)
        ],
    }


def _print(record: dict[str, Any], files: list[str], command: Plan) -> None:
    """Print the outcome in one line, and the figures."""
    console = console_for(command)
    effort = f"{record['checks']} checks in {record['time_s']:.1f} s"
    if not record["found"]:
        where = f"no path to {record['goal']} after {effort}: {record['reason']}"
        if record["status"] == SearchStatus.BUDGET_SPENT.value:
            where += f"; next: a higher --max-checks than {command.max_checks}"
        saved = f"; its free beginning: {', '.join(files)}" if files else ""
        console.print(f"[bold red]{escape(where + saved)}", soft_wrap=True)
        return
    took = f"{record['duration_s']:.2f} s, length {record['length']:.1f}"
    headline = f"path to {record['goal']}: {took}"
    console.print(f"[bold green]{escape(headline)}")
    table = Table.grid(padding=(0, 2))
    how = "refined from loose to strict" if record["refined"] else "strict constraints"
    rows = {
        "start": f"{record['start_class']}, seed {record['seed']}",
        "search": f"{effort}, {record['nodes']} nodes, {how}",
        "way out": record["way_out_m"]
        and f"{record['way_out_m']:.2f} m, moved as it lies: a rise crawls",
        "keys": ", ".join(f"{key['name']} at {key['time_s']:.2f} s" for key in record["keys"]),
        "files": ", ".join(files),
        "no film": record["strip_reason"],
    }
    for label, text in rows.items():
        if text:
            table.add_row(f"[dim]{label}", escape(text))
    console.print(table)
