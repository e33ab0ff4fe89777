"""Building motions side by side, in processes, with a bar for each."""

from __future__ import annotations

import multiprocessing
import queue
import signal
from collections.abc import Callable
from concurrent.futures import Future, ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing.queues import Queue
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
)
from rich.table import Table
from tyro.conf import Positional, arg

from humanoid_getup.cli.errors import BadInputError, refusing
from humanoid_getup.cli.exit_codes import DID_IT, DID_NOT_STAND
from humanoid_getup.cli.options import RobotOption
from humanoid_getup.cli.output import (
    console_for,
    find_file_faults,
    find_folder_faults,
    find_json_faults,
    staging,
    to_json,
    write_json,
)
from humanoid_getup.cli.play import find_motion
from humanoid_getup.motions.build import KEYFRAMES, build_motion, load_authored, motion_file
from humanoid_getup.motions.keyframes import Keyframes
from humanoid_getup.motions.motion import MIRRORED_SUFFIX, Motion
from humanoid_getup.motions.motion_database import MOTION_FOLDER, load_database
from humanoid_getup.reporting import film_strip
from humanoid_getup.simulation.scene import load_scene
from humanoid_getup.simulation.world import World
from robots import Robot
from robots.kinematics import place

LOOK = 0.2  # s between two looks at the progress

_news: Queue | None = None
"""In a worker: where it tells its progress."""


@dataclass(frozen=True, kw_only=True)
class BuildJob:
    """What all motions are built with."""

    robot: Robot
    generations: int
    seed: int
    jobs: int
    """Processes."""


def build_all(
    keyframes: list[Keyframes], recipe: BuildJob, save: Callable[[Motion], None]
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
            c.name: progress.add_task(c.name, total=recipe.generations, told="") for c in keyframes
        }
        pool = ProcessPoolExecutor(recipe.jobs, context, _start_worker, (news,))
        try:
            waiting = {pool.submit(_build, c, recipe): c.name for c in keyframes}
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


def _build(keyframes: Keyframes, recipe: BuildJob) -> Motion:
    def report(generation: int, cost: float, stood: float) -> None:
        if _news is not None:
            _news.put((keyframes.name, generation, cost, stood))

    generations, seed = recipe.generations, recipe.seed
    motion, _ = build_motion(
        recipe.robot, keyframes, generations=generations, seed=seed, report=report
    )
    return motion


@dataclass(frozen=True, kw_only=True)
class ListMotions(RobotOption):
    """List a robot's rising motions."""

    json: Annotated[str | None, arg(metavar="FILE|-")] = None
    """Write the list to a file; - prints it alone on standard output."""

    def run(self) -> int:
        """Print a table, or JSON."""
        if faults := find_json_faults(self.json):
            raise BadInputError("; ".join(faults))
        robot = self.load_robot()
        with refusing():
            motions = load_database(robot).motions
        stored = [motion for motion in motions if not motion.name.endswith(MIRRORED_SUFFIX)]
        mirrored = {motion.name for motion in motions} - {motion.name for motion in stored}
        rows = [_describe(m, m.name + MIRRORED_SUFFIX in mirrored) for m in stored]
        write_json(to_json({"robot": robot.name, "motions": rows}), self.json)
        if self.json is None:
            console_for(self.json).print(_tabulate(rows))
        return DID_IT


@dataclass(frozen=True, kw_only=True)
class BuildMotions(RobotOption):
    """Build rising motions from authored key postures into the robot's folder."""

    names: Positional[tuple[str, ...]] = ()
    """Motions to build; all of the robot's keyframes when left out."""
    generations: int = 20
    """Of the search that improves the key postures, 1 or more."""
    seed: int = 0
    """Seed of the search, 0 or more."""
    jobs: int = 2
    """Motions that are built side by side, 1 or more."""

    def run(self) -> int:
        """Build them; report which do not end in a held stand."""
        robot = self.load_robot()
        faults = [
            f"{name} is {value}, allowed {least} or more"
            for name, value, least in (
                ("generations", self.generations, 1),
                ("seed", self.seed, 0),
                ("jobs", self.jobs, 1),
            )
            if value < least
        ]
        folder = robot.folder / MOTION_FOLDER
        if faults := faults + find_folder_faults(folder, ()):
            raise BadInputError("; ".join(faults))
        chosen = _choose(robot, self.names)
        recipe = BuildJob(robot=robot, generations=self.generations, seed=self.seed, jobs=self.jobs)
        console = console_for(None)

        def save(motion: Motion) -> None:
            folder.mkdir(exist_ok=True)
            motion.save(motion_file(robot.folder, motion.name))

        failures = build_all(chosen, recipe, save)
        console.print(f"built {len(chosen) - len(failures)} of {len(chosen)} into {folder}")
        for failure in failures:
            console.print(f"[red]not built: {failure}")
        return DID_NOT_STAND if failures else DID_IT


@dataclass(frozen=True, kw_only=True)
class ShowMotion(RobotOption):
    """Draw a rising motion as a film strip."""

    motion: Annotated[Positional[str], arg(metavar="MOTION")]
    """A motion's name in the robot's database, or an .npz file."""
    out: Annotated[Path | None, arg(metavar="FILE")] = None
    """PNG file to write; MOTION.png when left out."""

    def run(self) -> int:
        """Draw the postures that the motion went through when it was built."""
        robot = self.load_robot()
        motion = find_motion(robot, self.motion)
        path = self.out or Path(f"{motion.name}.png")
        if faults := find_file_faults(path):
            raise BadInputError("; ".join(faults))
        model = World.build(robot, load_scene("flat")).model
        rows = film_strip.pick_frames(_count_rising_frames(motion))
        qpos = np.array([place(robot, model, motion.posture(int(row))) for row in rows])
        try:
            pictures = film_strip.render_frames(robot, model, qpos)
        except film_strip.NoRendererError as error:
            Console(stderr=True, highlight=False).print(f"no film strip: {error}")
            return DID_NOT_STAND
        with staging(path.parent, (path.name,)) as folder:
            times = motion.time[rows] - motion.time[0]
            title = f"{motion.name}: {motion.strategy}"
            film_strip.save_strip(pictures, times, folder / path.name, title=title)
        console_for(None).print(f"film strip in {path}")
        return DID_IT


def _count_rising_frames(motion: Motion) -> int:
    """Count a motion's frames until it stands, or all where that is not known."""
    stands = motion.provenance.get("stand_time_s", motion.duration)
    end = motion.time[0] + float(stands) + film_strip.AFTERMATH
    return int(np.searchsorted(motion.time, min(end, motion.time[-1]), side="right"))


def _choose(robot: Robot, names: tuple[str, ...]) -> list[Keyframes]:
    file = robot.folder / KEYFRAMES
    with refusing():
        try:
            authored = {c.name: c for c in load_authored(robot)}
        except (KeyError, TypeError, ValueError) as error:
            raise ValueError(f"{file}: {error!r}") from error
        unknown = [name for name in names if name not in authored]
        if unknown:
            told = ", ".join(f"'{name}'" for name in unknown)
            raise ValueError(f"unknown motion {told}: allowed {', '.join(authored)}")
    return [authored[name] for name in names or authored]


def _describe(motion: Motion, is_mirrored: bool) -> dict[str, Any]:
    made = motion.provenance
    return {
        "name": motion.name,
        "start_class": motion.start_class,
        "strategy": motion.strategy,
        "duration_s": motion.duration,
        "stand_time_s": made.get("stand_time_s"),
        "robust": made.get("disturbed_success"),
        "torque_limit_nm": made.get("torque_limit"),
        "mirrored": is_mirrored,
    }


def _tabulate(rows: list[dict[str, Any]]) -> Table:
    table = Table(box=None, header_style="bold")
    table.add_column("motion", no_wrap=True)
    for heading in ("start", "strategy"):
        table.add_column(heading)
    for heading in ("lasts [s]", "stands [s]", "robust", "limit [N·m]", "mirrored"):
        table.add_column(heading, justify="right")
    for row in rows:
        table.add_row(
            row["name"],
            row["start_class"],
            row["strategy"],
            f"{row['duration_s']:.2f}",
            _format(row["stand_time_s"], ".2f"),
            _format(row["robust"], ".0%"),
            _format(row["torque_limit_nm"], ".1f"),
            "yes" if row["mirrored"] else "",
        )
    return table


def _format(value: Any, form: str) -> str:
    return format(value, form) if isinstance(value, int | float) else "?"
