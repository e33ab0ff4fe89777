"""`getup motions build`: build motions in parallel processes, with a progress bar for each."""

from __future__ import annotations

import queue
from collections.abc import Callable
from concurrent.futures import Future
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

from humanoid_getup.cli.errors import BadInputError, refusing
from humanoid_getup.cli.exit_codes import DID_IT, DID_NOT_STAND
from humanoid_getup.cli.inputs import load_robot
from humanoid_getup.cli.options.motions import BuildMotions
from humanoid_getup.cli.output import console_for, find_folder_faults
from humanoid_getup.motions.build import build_motion, load_robot_keyframes, motion_file
from humanoid_getup.motions.keyframes import Keyframes
from humanoid_getup.motions.motion import Motion
from humanoid_getup.motions.motion_database import MOTION_FOLDER
from humanoid_getup.worker_pool import SPAWN, worker_pool
from robots import Robot

POLL_TIME = 0.2  # s between two reads of the workers' progress

_progress: Queue | None = None
"""In a worker: the queue of its progress reports."""


def build(command: BuildMotions) -> int:
    """Build the motions; report those that do not end in a held stand."""
    robot = load_robot(command)
    folder = robot.folder / MOTION_FOLDER
    if faults := find_folder_faults(folder, ()):
        raise BadInputError("; ".join(faults))
    chosen = _choose_keyframes(robot, command.names)

    def save(motion: Motion) -> None:
        folder.mkdir(exist_ok=True)
        motion.save(motion_file(robot.folder, motion.name))

    failures = _build_all(robot, chosen, command, save)
    console = console_for(None)
    console.print(f"built {len(chosen) - len(failures)} of {len(chosen)} into {folder}")
    for failure in failures:
        console.print(f"[red]not built: {failure}")
    return DID_NOT_STAND if failures else DID_IT


def _choose_keyframes(robot: Robot, names: tuple[str, ...]) -> list[Keyframes]:
    with refusing():
        stored = {c.name: c for c in load_robot_keyframes(robot)}
        unknown = [name for name in names if name not in stored]
        if unknown:
            listed = ", ".join(f"'{name}'" for name in unknown)
            raise ValueError(f"unknown motion {listed}, expected {', '.join(stored)}")
    return [stored[name] for name in dict.fromkeys(names or stored)]


def _build_all(
    robot: Robot, keyframes: list[Keyframes], command: BuildMotions, save: Callable[[Motion], None]
) -> list[str]:
    """Build motions in processes, save each when it is ready; return why the others failed."""
    reports: Queue = SPAWN.Queue()
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn())
    note = TextColumn("[dim]{task.fields[note]}")
    with Progress(*columns, TimeElapsedColumn(), note, console=Console(stderr=True)) as progress:
        bars = {
            c.name: progress.add_task(c.name, total=command.generations, note="") for c in keyframes
        }
        with worker_pool(command.jobs, _start_worker, reports) as pool:
            waiting = {pool.submit(_build, robot, c, command): c.name for c in keyframes}
            failures: list[str] = []
            while waiting:
                _show(reports, progress, bars)
                failures += _collect(waiting, save)
            return failures


def _collect(waiting: dict[Future[Motion], str], save: Callable[[Motion], None]) -> list[str]:
    """Save the motions that are ready; return why others failed."""
    failures = []
    for future in [future for future in waiting if future.done()]:
        name = waiting.pop(future)
        try:
            save(future.result())
        except (RuntimeError, ValueError, OSError) as error:  # no stand, disk full...
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


def _build(robot: Robot, keyframes: Keyframes, command: BuildMotions) -> Motion:
    def report(generation: int, cost: float, stood: float) -> None:
        if _progress is not None:
            _progress.put((keyframes.name, generation, cost, stood))

    motion, _ = build_motion(
        robot,
        keyframes,
        generations=command.generations,
        seed=command.seed,
        prefer=command.prefer,
        report=report,
    )
    return motion
