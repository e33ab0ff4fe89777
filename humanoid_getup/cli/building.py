"""Building motions in parallel processes, with a progress bar for each."""

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

from humanoid_getup.motions.build import build_motion
from humanoid_getup.motions.keyframes import Keyframes
from humanoid_getup.motions.motion import Motion
from robots import Robot

POLL_TIME = 0.2  # s between two reads of the workers' progress

_progress: Queue | None = None
"""In a worker: the queue of its progress reports."""


@dataclass(frozen=True, kw_only=True)
class BuildJob:
    """Settings that all motions are built with."""

    robot: Robot
    generations: int
    seed: int
    jobs: int
    """Processes."""


def build_all(
    keyframes: list[Keyframes], job: BuildJob, save: Callable[[Motion], None]
) -> list[str]:
    """Build motions in processes, save each when it is ready; return why the others failed.

    The processes end with this function, however it ends.
    """
    context = multiprocessing.get_context("spawn")
    reports: Queue = context.Queue()
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn())
    note = TextColumn("[dim]{task.fields[note]}")
    with Progress(*columns, TimeElapsedColumn(), note, console=Console(stderr=True)) as progress:
        bars = {
            c.name: progress.add_task(c.name, total=job.generations, note="") for c in keyframes
        }
        pool = ProcessPoolExecutor(job.jobs, context, _start_worker, (reports,))
        try:
            waiting = {pool.submit(_build, c, job): c.name for c in keyframes}
            failures: list[str] = []
            while waiting:
                _show(reports, progress, bars)
                failures += _collect(waiting, save)
            return failures
        finally:
            pool.shutdown(wait=False, cancel_futures=True)
            for process in multiprocessing.active_children():
                process.terminate()


def _collect(waiting: dict[Future[Motion], str], save: Callable[[Motion], None]) -> list[str]:
    """Save the motions that are ready; return why others failed."""
    failures = []
    for future in [future for future in waiting if future.done()]:
        name = waiting.pop(future)
        try:
            save(future.result())
        except (RuntimeError, ValueError, KeyError, OSError) as error:  # no stand, no disk...
            failures.append(f"{name}: {error}")
    return failures


def _show(reports: Queue, progress: Progress, bars: dict[str, TaskID]) -> None:
    try:
        name, generation, cost, stood = reports.get(timeout=POLL_TIME)
    except queue.Empty:
        return
    note = f"cost {cost:.2f}, {stood:.0%} stood"
    progress.update(bars[name], completed=generation + 1, note=note)


def _start_worker(reports: Queue) -> None:
    global _progress
    _progress = reports
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent ends its workers


def _build(keyframes: Keyframes, job: BuildJob) -> Motion:
    def report(generation: int, cost: float, stood: float) -> None:
        if _progress is not None:
            _progress.put((keyframes.name, generation, cost, stood))

    generations, seed = job.generations, job.seed
    motion, _ = build_motion(
        job.robot, keyframes, generations=generations, seed=seed, report=report
    )
    return motion
