"""The plan cache of `getup rise`, and `getup plan-cache`, which lists or clears it."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

from rich.markup import escape

from humanoid_getup.cli.console import console_for, make_table
from humanoid_getup.cli.exit_codes import DID_IT
from humanoid_getup.cli.options.motions import ListPlanCache
from humanoid_getup.cli.options.rise import Rise
from humanoid_getup.cli.output import write_json
from humanoid_getup.jobs.errors import BadInputError, refusing
from humanoid_getup.strategies.cache.cached_rise import CachedRise
from humanoid_getup.strategies.cache.plan_cache import CacheEntry, PlanCache, now
from humanoid_getup.strategies.plan import Strategy
from humanoid_getup.strategies.planned_rise import PlannedRise

REMEDY = "getup plan-cache --clear"
MANY = 3  # damaged files that one line names
AGES = ((86400.0, "d"), (3600.0, "h"), (60.0, "min"), (1.0, "s"))


def use_cache(command: Rise, planner: PlannedRise) -> Strategy:
    """Give a planner the cache of a command; rises through key postures have none.

    Raises:
        BadInputError: if the command names a folder that holds damaged entries. Those of the
            user's own folder are ignored, with a line on standard error.
    """
    if not (command.plan_cache and command.filtering) or command.key:
        return planner
    with refusing():
        cache = PlanCache(command.cache_folder)
        if command.cache_folder is not None:
            _refuse_damage(cache, planner.world.robot.name, command.cache_folder)
    return CachedRise(planner, cache, report=_warn)


def list_or_clear(command: ListPlanCache) -> int:
    """Print a table or JSON of the solved rises, or remove them."""
    with refusing():
        cache = PlanCache(command.cache_folder)
        if command.clear:
            return _clear(cache, command)
        _refuse_damage(cache, command.robot, command.cache_folder)
        rows = [_describe(entry) for entry in cache.read(command.robot).entries]
    write_json({"folder": str(cache.folder), "entries": rows}, command)
    if command.json is None:
        _print(rows, cache, command.robot)
    return DID_IT


def _clear(cache: PlanCache, command: ListPlanCache) -> int:
    removed = cache.clear(command.robot)
    write_json({"folder": str(cache.folder), "removed": removed}, command)
    text = f"{removed} {'rise' if removed == 1 else 'rises'} removed from {cache.folder}"
    console_for(command).print(escape(text))
    return DID_IT


def _refuse_damage(cache: PlanCache, robot: str | None, named: Path | None) -> None:
    """Refuse damaged entries of a robot, or of all; ``named`` is the option --cache-folder."""
    problems = cache.find_problems(robot)
    if problems:
        more = f"; and {len(problems) - MANY} others" if len(problems) > MANY else ""
        remedy = REMEDY if named is None else f"{REMEDY} --cache-folder {named}"
        raise BadInputError(f"{'; '.join(problems[:MANY])}{more} (remedy: {remedy})")


def _warn(problem: str) -> None:
    print(f"getup: {problem}", file=sys.stderr)


def _describe(entry: CacheEntry) -> dict[str, Any]:
    rise = entry.rise
    return {
        "name": entry.name,
        "robot": rise.context.robot,
        "scene": rise.context.scene,
        "torque_limit_nm": rise.context.torque_limit,
        "limit_by": rise.context.limit_by,
        "prefer": rise.context.prefer,
        "start_class": rise.start_class,
        "connection": rise.connection,
        "stand_time_s": rise.stand_time,
        "robust": rise.robust,
        "age_s": max(now() - rise.made, 0.0),
        "bytes": entry.size,
    }


def _print(rows: list[dict[str, Any]], cache: PlanCache, robot: str | None) -> None:
    texts = ("rise", "robot", "scene", "start", "joins", "prefers")
    numbers = ("limit [N·m]", "stands [s]", "robust", "age", "size [kB]")
    table = make_table((*texts, *numbers), left=texts)
    for row in rows:
        limit = row["torque_limit_nm"]
        table.add_row(
            row["name"],
            row["robot"],
            row["scene"],
            row["start_class"],
            row["connection"],
            row["prefer"],
            "full" if limit is None else f"{limit:g} by {row['limit_by']}",
            f"{row['stand_time_s']:.2f}",
            f"{row['robust']:.0%}",
            _format_age(row["age_s"]),
            f"{row['bytes'] / 1000.0:.0f}",
        )
    if rows:
        console_for().print(table)
    of = f" of robot '{robot}'" if robot else ""
    size = sum(row["bytes"] for row in rows) / 1e6
    what = "solved rise" if len(rows) == 1 else "solved rises"
    console_for().print(escape(f"{len(rows)} {what}{of}, {size:.1f} MB, in {cache.folder}"))


def _format_age(age: float) -> str:
    """Write an age [s] in whole units."""
    length, unit = next((pair for pair in AGES if age >= pair[0]), AGES[-1])
    return f"{age // length:.0f} {unit}"
