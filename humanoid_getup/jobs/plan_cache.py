"""Opens the plan cache of a command, and refuses a damaged one."""

from __future__ import annotations

from pathlib import Path

from humanoid_getup.jobs.errors import BadInputError, refusing
from humanoid_getup.strategies.cache.plan_cache import PlanCache
from robots import list_robots

REMEDY = "getup plan-cache --clear"
MANY = 3  # damaged files that one line names


def open_plan_cache(folder: Path | None = None) -> PlanCache:
    """Open the cache in a folder; ``None`` for that of the user."""
    with refusing():
        return PlanCache(folder)


def check_robot_name(cache: PlanCache, robot: str | None) -> None:
    """Refuse a robot that neither comes with the program nor has stored plans.

    Raises:
        BadInputError: naming those that are known.
    """
    known = dict.fromkeys([*list_robots(), *cache.list_robots()])
    if robot is not None and robot not in known:
        raise BadInputError(f"unknown robot '{robot}': expected {', '.join(known)}")


def refuse_damage(cache: PlanCache, robot: str | None, named: Path | None) -> None:
    """Refuse damaged entries of a robot, or of all; ``named`` is the option --cache-folder."""
    problems = cache.find_problems(robot)
    if problems:
        more = f"; and {len(problems) - MANY} others" if len(problems) > MANY else ""
        remedy = REMEDY if named is None else f"{REMEDY} --cache-folder {named}"
        raise BadInputError(f"{'; '.join(problems[:MANY])}{more} (remedy: {remedy})")
