"""`getup plan`: plan a path, without physics, and say how the search went."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from rich.markup import escape
from rich.table import Table

from humanoid_getup.cli.console import console_for, phase
from humanoid_getup.cli.exit_codes import DID_IT, NO_PATH
from humanoid_getup.cli.options.plan import PATH, PLAN_FILES, STRIP, Plan
from humanoid_getup.cli.output import write_json
from humanoid_getup.experiments.starts import Fall
from humanoid_getup.jobs.errors import refusing
from humanoid_getup.jobs.inputs import find_start, load_keys, load_world
from humanoid_getup.jobs.output_files import staging
from humanoid_getup.motions.motion import Trajectory
from humanoid_getup.motions.motion_database import load_database
from humanoid_getup.motions.posture_metric import PostureMetric
from humanoid_getup.planning.path_planner import PathOptions
from humanoid_getup.planning.path_query import (
    Goal,
    PathAnswer,
    choose_goals,
    find_path,
    measure_length,
    to_motion,
)
from humanoid_getup.reporting import film_strip
from humanoid_getup.simulation.world import World
from robots.kinematics import place_postures


def plan(command: Plan) -> int:
    """Plan a path, and write it with a film strip and its figures; return the exit code."""
    world, rng = load_world(command), np.random.default_rng(command.seed)
    keys = load_keys(world, command.key)
    to = [] if command.to is None else load_keys(world, [command.to])
    with phase("falling") as report:
        start = find_start(world, str(command.origin), rng)
        if to:
            goals = [Goal(name=to[0].name, posture=to[0].posture)]
        else:
            last = keys[-1].posture if keys else start.posture
            with refusing():
                goals = choose_goals(load_database(world.robot), last)

        def show(goal: str, looseness: float | None) -> None:
            tightened = (
                "" if looseness is None else f", constraints tightened to {1 - looseness:.0%}"
            )
            report(f"planning to {goal}{tightened}")

        options = PathOptions(max_checks=command.max_checks, refines=command.refinement)
        answer = find_path(world, start.posture, keys, goals, rng, options, show)
        report("drawing")
        written, no_strip = _write(answer, world, command)
    record = _describe(answer, world, command, start) | {"strip_reason": no_strip}
    record["keys"] = [
        {"name": key.name, "time_s": _time_at(answer, number)} for number, key in enumerate(keys)
    ]
    write_json(record, command)
    _print(record, written, command)
    return DID_IT if answer.found else NO_PATH


def _write(answer: PathAnswer, world: World, command: Plan) -> tuple[list[str], str | None]:
    """Write the path and its film strip; return the files, and why there is no strip."""
    path = answer.path if answer.found or command.keep_partial else None
    if command.out is None:
        return [], None
    with staging(command.out, PLAN_FILES) as folder:
        no_strip: str | None = "there is no path"
        if path is not None:
            to_motion(world, path, answer, command.seed).save(folder / PATH)
            no_strip = _draw(path, world, folder / STRIP, answer.goal.name)
        written = [str(command.out / name) for name in PLAN_FILES if (folder / name).exists()]
    return written, no_strip


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


def _describe(answer: PathAnswer, world: World, command: Plan, start: Fall) -> dict[str, Any]:
    result, joined = answer.result, answer.goal.connection
    path = answer.path
    return {
        "robot": world.robot.name,
        "scene": command.scene,
        "seed": command.seed,
        "start": command.origin,
        "start_class": start.start_class,
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
    }


def _time_at(answer: PathAnswer, number: int) -> float | None:
    """Return when the path leaves a key posture [s]; ``None`` if it does not come that far."""
    path, arrivals = answer.path, answer.result.arrivals
    return None if path is None or number >= len(arrivals) else float(path.time[arrivals[number]])


def _print(record: dict[str, Any], files: list[str], command: Plan) -> None:
    """Print one line that says how it ended, and the figures."""
    console = console_for(command)
    effort = f"{record['checks']} checks in {record['time_s']:.1f} s"
    if not record["found"]:
        where = f"no path to {record['goal']} after {effort}: {record['reason']}"
        saved = f"; how far it leads: {', '.join(files)}" if files else ""
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
        "way out": record["way_out_m"] and f"{record['way_out_m']:.2f} m, moved as it lies",
        "keys": ", ".join(f"{key['name']} at {key['time_s']:.2f} s" for key in record["keys"]),
        "files": ", ".join(files),
        "no film": record["strip_reason"],
    }
    for label, text in rows.items():
        if text:
            table.add_row(f"[dim]{label}", escape(text))
    console.print(table)
