"""Building motions side by side, in processes, with a bar for each."""

from __future__ import annotations

import multiprocessing
import queue
import signal
from collections.abc import Callable
from concurrent.futures import Future, ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing.queues import Queue

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
)

from humanoid_getup.build import build_motion
from humanoid_getup.choreography import Choreography
from humanoid_getup.motion import Motion
from robots import Robot

LOOK = 0.2  # s between two looks at the progress

_news: Queue | None = None
"""In a worker: where it tells its progress."""


@dataclass(frozen=True, kw_only=True)
class Recipe:
    """What all motions are built with."""

    robot: Robot
    generations: int
    seed: int
    jobs: int
    """Processes."""


def build_all(
    choreographies: list[Choreography], recipe: Recipe, save: Callable[[Motion], None]
) -> list[str]:
    """Build motions, save each when it is there; return why the others are not.

    The processes end with this function, however it ends.
    """
    context = multiprocessing.get_context("spawn")
    news: Queue = context.Queue()
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn())
    told = TextColumn("[dim]{task.fields[told]}")
    with Progress(*columns, TimeElapsedColumn(), told, console=Console(stderr=True)) as progress:
        bars = {
            c.name: progress.add_task(c.name, total=recipe.generations, told="")
            for c in choreographies
        }
        pool = ProcessPoolExecutor(recipe.jobs, context, _start_worker, (news,))
        try:
            waiting = {pool.submit(_build, c, recipe): c.name for c in choreographies}
            failures: list[str] = []
            while waiting:
                _show(news, progress, bars)
                failures += _collect(waiting, save)
            return failures
        finally:
            pool.shutdown(wait=False, cancel_futures=True)
            for process in multiprocessing.active_children():
                process.terminate()


def _collect(waiting: dict[Future[Motion], str], save: Callable[[Motion], None]) -> list[str]:
    """Save the motions that are there; return why others will not be."""
    failures = []
    for future in [future for future in waiting if future.done()]:
        name = waiting.pop(future)
        try:
            save(future.result())
        except (RuntimeError, ValueError, KeyError, OSError) as error:  # no stand, no disk...
            failures.append(f"{name}: {error}")
    return failures


def _show(news: Queue, progress: Progress, bars: dict[str, TaskID]) -> None:
    try:
        name, generation, cost, stood = news.get(timeout=LOOK)
    except queue.Empty:
        return
    told = f"cost {cost:.2f}, {stood:.0%} stood"
    progress.update(bars[name], completed=generation + 1, told=told)


def _start_worker(news: Queue) -> None:
    global _news
    _news = news
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent ends its workers


def _build(choreography: Choreography, recipe: Recipe) -> Motion:
    def report(generation: int, cost: float, stood: float) -> None:
        if _news is not None:
            _news.put((choreography.name, generation, cost, stood))

    generations, seed = recipe.generations, recipe.seed
    motion, _ = build_motion(
        recipe.robot, choreography, generations=generations, seed=seed, report=report
    )
    return motion
