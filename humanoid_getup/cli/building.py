"""`getup motions build`: build motions in parallel processes, with a progress bar for each."""

from __future__ import annotations

import math
import queue
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from multiprocessing.queues import Queue
from pathlib import Path

from rich.console import Console
from rich.markup import escape
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from humanoid_getup.cli.errors import BadInputError, refusing
from humanoid_getup.cli.exit_codes import DID_IT, DID_NOT_STAND
from humanoid_getup.cli.inputs import find_keyframes, load_robot
from humanoid_getup.cli.motions import draw_motion
from humanoid_getup.cli.options.motions import BuildMotions
from humanoid_getup.cli.output import console_for, find_folder_faults
from humanoid_getup.motions.build import (
    UNFINISHED,
    Build,
    build_motion,
    make_task,
    motion_file,
    unfinished_file,
)
from humanoid_getup.motions.keyframes import Keyframes
from humanoid_getup.motions.keyframes_file import KEYFRAMES
from humanoid_getup.motions.keyframes_writer import replace_keyframes, save_keyframes
from humanoid_getup.motions.motion_database import MOTION_FOLDER
from humanoid_getup.motions.optimization import count_work
from humanoid_getup.motions.search_log import SearchLog
from humanoid_getup.reporting.film_strip import NoRendererError
from humanoid_getup.worker_pool import SPAWN, worker_pool
from robots import Robot

POLL_TIME = 0.2  # s between two reads of the workers' progress
LOG, BEST, KEYS, STRIP = ".json", ".npz", ".toml", ".png"
"""What the folder of unfinished motions keeps of each: its search, its best try, keys, pictures."""

_progress: Queue | None = None
"""In a worker: the queue of its progress reports."""


def build(command: BuildMotions) -> int:
    """Build the motions; report those that do not end as they should."""
    robot = load_robot(command)
    for folder in (MOTION_FOLDER, UNFINISHED):
        if faults := find_folder_faults(robot.folder / folder, ()):
            raise BadInputError("; ".join(faults))
    return build_rest(robot, find_keyframes(robot, command.names), command)


def build_rest(robot: Robot, chosen: list[Keyframes], command: BuildMotions) -> int:
    """Build motions into the robot's folder; report those that do not end as they should."""
    done = _count_done(robot, chosen, command)
    try:
        failures = _build_all(robot, chosen, command, done)
    except KeyboardInterrupt as interrupt:
        again = " ".join(["getup motions build", *command.names, "--resume"])
        raise KeyboardInterrupt(f"{again} goes on") from interrupt
    console, built = console_for(None), len(chosen) - len(failures)
    console.print(f"built {built} of {len(chosen)} into {robot.folder / MOTION_FOLDER}")
    for failure in failures:
        console.print(f"[red]not built:[/] {escape(failure)}")
    return DID_NOT_STAND if failures else DID_IT


def open_log(robot: Robot, keyframes: Keyframes, command: BuildMotions) -> SearchLog:
    """Open the log of a search: with ``--resume`` the one that is there, else a new one."""
    path = unfinished_file(robot.folder, keyframes.name, LOG)
    task = make_task(robot, keyframes, command.seed, command.prefer)
    return SearchLog.resume(path, task) if command.resume else SearchLog(path, task)


def keep(build: Build, robot: Robot, *, keep_keys: bool) -> str:
    """Store a motion, or the best try and why it is none; return why it is none, and where."""
    name = build.motion.name
    if build.failure:
        return f"{build.failure}; its best try: {_keep_best(build, robot)}"
    motion_file(robot.folder, name).parent.mkdir(exist_ok=True)
    build.motion.save(motion_file(robot.folder, name))
    for suffix in (LOG, BEST, KEYS, STRIP):
        unfinished_file(robot.folder, name, suffix).unlink(missing_ok=True)
    if keep_keys:
        replace_keyframes(robot.folder / KEYFRAMES, [build.keyframes], robot)
    return ""


def _keep_best(build: Build, robot: Robot) -> Path:
    """Keep the best try of a motion that failed; return its file."""
    files = {s: unfinished_file(robot.folder, build.motion.name, s) for s in (BEST, KEYS, STRIP)}
    files[BEST].parent.mkdir(exist_ok=True)
    build.motion.save(files[BEST])
    save_keyframes(files[KEYS], [build.keyframes], robot)
    try:
        draw_motion(robot, build.motion, files[STRIP])
    except NoRendererError:
        return files[BEST]  # there is no strip without a GL
    return files[STRIP]


def _count_done(
    robot: Robot, keyframes: Sequence[Keyframes], command: BuildMotions
) -> dict[str, int]:
    """Count the generations in the logs, which are checked before any work; tell what goes on."""
    with refusing():
        done = {each.name: len(open_log(robot, each, command).generations) for each in keyframes}
    for name, count in done.items() if command.resume else ():
        going_on = f"goes on after generation {count}" if count else "begins: there is no log of it"
        console_for(None).print(f"{name} {going_on}", markup=False)
    return done


def _build_all(
    robot: Robot, keyframes: list[Keyframes], command: BuildMotions, done: dict[str, int]
) -> list[str]:
    """Build motions in processes, keep each when it is ready; return why some failed."""
    reports: Queue = SPAWN.Queue()
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn())
    note = TextColumn("[dim]{task.fields[note]}")
    times = (TimeElapsedColumn(), TimeRemainingColumn())
    with Progress(*columns, *times, note, console=Console(stderr=True)) as progress:
        bars = {
            c.name: progress.add_task(c.name, total=command.generations, note="") for c in keyframes
        }
        rounds = math.ceil(len(keyframes) / command.jobs)
        work = rounds * count_work(command.generations, min(done.values()))
        watch = _Watch(reports, progress, bars, work=work, done=done)
        with worker_pool(command.jobs, _start_worker, reports) as pool:
            waiting = {pool.submit(_build, robot, c, command): c.name for c in keyframes}
            failures: list[str] = []
            while waiting:
                watch.show_next()
                failures += _collect(waiting, lambda b: keep(b, robot, keep_keys=command.keep_keys))
            return failures


def _collect(waiting: dict[Future[Build], str], keep: Callable[[Build], str]) -> list[str]:
    """Keep what is ready; return why some failed."""
    failures = []
    for future in [future for future in waiting if future.done()]:
        name = waiting.pop(future)
        try:
            failure = keep(future.result())
        except (RuntimeError, ValueError, OSError) as error:  # a worker that died, disk full...
            failure = f"{name}: {error}"
        if failure:
            failures.append(failure)
    return failures


class _Watch:
    """Shows the reports of workers, and after a generation or two how long all will take."""

    def __init__(
        self,
        reports: Queue,
        progress: Progress,
        bars: dict[str, TaskID],
        *,
        work: float,
        done: dict[str, int],
    ) -> None:
        """Prepare for so much work, in generations one after the other, beside those done."""
        self._reports, self._progress, self._bars = reports, progress, bars
        self._work, self._done = work, done
        self._last: dict[str, float] = {}
        self._is_estimated = False

    def show_next(self) -> None:
        """Wait for a report and show it."""
        try:
            name, generation, cost, stood = self._reports.get(timeout=POLL_TIME)
        except queue.Empty:
            return
        note = f"cost {cost:.2f}, {stood:.0%} stood"
        self._progress.update(self._bars[name], completed=generation + 1, note=note)
        self._estimate(name, generation)

    def _estimate(self, name: str, generation: int) -> None:
        """Say once how long the build will take, from the time since the generation before."""
        now = time.monotonic()
        before = self._last.get(name)
        self._last[name] = now
        if self._is_estimated or before is None or generation < self._done[name]:
            return
        self._is_estimated = True
        minutes = math.ceil((now - before) * self._work / 60.0)
        self._progress.console.print(f"this will take about {minutes} min")


def _start_worker(reports: Queue) -> None:
    global _progress
    _progress = reports


def _build(robot: Robot, keyframes: Keyframes, command: BuildMotions) -> Build:
    def report(generation: int, cost: float, stood: float) -> None:
        if _progress is not None:
            _progress.put((keyframes.name, generation, cost, stood))

    return build_motion(
        robot,
        keyframes,
        generations=command.generations,
        seed=command.seed,
        prefer=command.prefer,
        report=report,
        log=open_log(robot, keyframes, command),
    )
