"""`getup plan-cache`: lists or clears the plan cache of `getup rise`."""

from __future__ import annotations

import msgspec
from rich.markup import escape

from humanoid_getup.cli.options.motions import ListPlanCache
from humanoid_getup.cli.shared.console import console_for, make_table
from humanoid_getup.cli.shared.exit_codes import DID_IT
from humanoid_getup.cli.shared.output import write_json
from humanoid_getup.jobs.errors import refusing
from humanoid_getup.jobs.plan_cache import check_robot_name, open_plan_cache, refuse_damage
from humanoid_getup.strategies.cache.plan_cache import CacheEntry, PlanCache, now
from robots.servo import LimitMode

AGES = ((86400.0, "d"), (3600.0, "h"), (60.0, "min"), (1.0, "s"))


class CacheRow(msgspec.Struct, frozen=True, kw_only=True):
    """A stored rise in the list."""

    name: str
    robot: str
    scene: str
    torque_limit_nm: float | None
    limit_by: LimitMode
    prefer: str
    start_class: str
    connection: str
    stand_time_s: float
    robust: float
    age_s: float
    bytes: int


def list_or_clear(command: ListPlanCache) -> int:
    """Print a table or JSON of the stored plans, or remove them."""
    with refusing():
        cache = open_plan_cache(command.cache_folder)
        check_robot_name(cache, command.robot)
        if command.clear:
            return _clear(cache, command)
        refuse_damage(cache, command.robot, command.cache_folder)
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


def _describe(entry: CacheEntry) -> CacheRow:
    rise, context = entry.rise, entry.rise.context
    return CacheRow(
        name=entry.name,
        robot=context.robot,
        scene=context.scene,
        torque_limit_nm=context.torque_limit,
        limit_by=context.limit_by,
        prefer=context.prefer,
        start_class=rise.start_class,
        connection=rise.connection,
        stand_time_s=rise.stand_time,
        robust=rise.robust,
        age_s=max(now() - rise.made, 0.0),
        bytes=entry.size,
    )


def _print(rows: list[CacheRow], cache: PlanCache, robot: str | None) -> None:
    texts = ("rise", "robot", "scene", "start", "joins", "prefers")
    numbers = ("limit [N·m]", "stands [s]", "robust", "age", "size [kB]")
    table = make_table((*texts, *numbers), left=texts)
    for row in rows:
        limit = row.torque_limit_nm
        table.add_row(
            row.name,
            row.robot,
            row.scene,
            row.start_class,
            row.connection,
            row.prefer,
            "full" if limit is None else f"{limit:g} by {row.limit_by}",
            f"{row.stand_time_s:.2f}",
            f"{row.robust:.0%}",
            _format_age(row.age_s),
            f"{row.bytes / 1000.0:.0f}",
        )
    if rows:
        console_for().print(table)
    of = f" of robot '{robot}'" if robot else ""
    size = sum(row.bytes for row in rows) / 1e6
    what = "solved rise" if len(rows) == 1 else "solved rises"
    console_for().print(escape(f"{len(rows)} {what}{of}, {size:.1f} MB, in {cache.folder}"))


def _format_age(age: float) -> str:
    """Write an age [s] in whole units."""
    length, unit = next((pair for pair in AGES if age >= pair[0]), AGES[-1])
    return f"{age // length:.0f} {unit}"
