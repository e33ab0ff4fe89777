"""`getup motions list`, `build` and `show`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from tyro.conf import Positional, arg

from humanoid_getup.cli.checks import at_least
from humanoid_getup.cli.errors import BadInputError, refusing
from humanoid_getup.cli.exit_codes import DID_IT, DID_NOT_STAND
from humanoid_getup.cli.options import JsonTarget, MotionName, RobotOption, Seed
from humanoid_getup.cli.output import (
    console_for,
    find_file_faults,
    find_folder_faults,
    find_json_faults,
    phase,
    staging,
    to_json,
    write_json,
)

if TYPE_CHECKING:
    from humanoid_getup.motions.keyframes import Keyframes
    from humanoid_getup.motions.motion import Motion
    from robots import Robot


@dataclass(frozen=True, kw_only=True)
class ListMotions(RobotOption):
    """List a robot's rising motions."""

    json: JsonTarget = None

    def run(self) -> int:
        """Print a table, or JSON."""
        if faults := find_json_faults(self.json):
            raise BadInputError("; ".join(faults))
        from humanoid_getup.motions.motion import MIRRORED_SUFFIX
        from humanoid_getup.motions.motion_database import load_database

        robot = self.load_robot()
        with refusing():
            motions = load_database(robot).motions
        stored = [motion for motion in motions if not motion.name.endswith(MIRRORED_SUFFIX)]
        mirrored = {motion.name for motion in motions} - {motion.name for motion in stored}
        rows = [_describe(m, m.name + MIRRORED_SUFFIX in mirrored) for m in stored]
        write_json(to_json({"robot": robot.name, "motions": rows}), self.json)
        if self.json is None:
            _print(rows)
        return DID_IT


@dataclass(frozen=True, kw_only=True)
class BuildMotions(RobotOption):
    """Build rising motions from keyframes into the robot's folder."""

    names: Positional[tuple[str, ...]] = ()
    """Motions to build; default: all of the robot's keyframes."""
    generations: Annotated[int, at_least(1)] = 20
    """Generations of the search that optimizes the keyframes."""
    seed: Seed = 0
    jobs: Annotated[int, at_least(1)] = 2
    """Motions that are built in parallel."""

    def run(self) -> int:
        """Build the motions; report those that do not end in a held stand."""
        robot = self.load_robot()
        with phase("loading"):
            from humanoid_getup.cli.building import BuildJob, build_all
            from humanoid_getup.motions.build import motion_file
            from humanoid_getup.motions.motion_database import MOTION_FOLDER

            folder = robot.folder / MOTION_FOLDER
            if faults := find_folder_faults(folder, ()):
                raise BadInputError("; ".join(faults))
            chosen = _choose(robot, self.names)
        job = BuildJob(robot=robot, generations=self.generations, seed=self.seed, jobs=self.jobs)

        def save(motion: Motion) -> None:
            folder.mkdir(exist_ok=True)
            motion.save(motion_file(robot.folder, motion.name))

        failures = build_all(chosen, job, save)
        console = console_for(None)
        console.print(f"built {len(chosen) - len(failures)} of {len(chosen)} into {folder}")
        for failure in failures:
            console.print(f"[red]not built: {failure}")
        return DID_NOT_STAND if failures else DID_IT


@dataclass(frozen=True, kw_only=True)
class ShowMotion(RobotOption):
    """Draw a rising motion as a film strip."""

    motion: Positional[MotionName]
    out: Annotated[Path | None, arg(metavar="FILE")] = None
    """PNG file to write; default: MOTION.png."""

    def run(self) -> int:
        """Draw the postures that the motion went through when it was built."""
        robot = self.load_robot()
        from humanoid_getup.cli.rising import find_motion

        motion = find_motion(robot, self.motion)
        path = self.out or Path(f"{motion.name}.png")
        if faults := find_file_faults(path):
            raise BadInputError("; ".join(faults))
        with phase("drawing"):
            _draw(robot, motion, path)
        console_for(None).print(f"film strip in {path}")
        return DID_IT


def _draw(robot: Robot, motion: Motion, path: Path) -> None:
    import numpy as np

    from humanoid_getup.reporting import film_strip
    from humanoid_getup.simulation.scene import load_scene
    from humanoid_getup.simulation.world import World
    from robots.kinematics import place

    model = World.build(robot, load_scene("flat")).model
    # The frames until the motion stands, or all where that is not known.
    stands = motion.provenance.get("stand_time_s", motion.duration)
    end = motion.time[0] + float(stands) + film_strip.AFTERMATH
    count = int(np.searchsorted(motion.time, min(end, motion.time[-1]), side="right"))
    rows = film_strip.pick_frames(count)
    qpos = np.array([place(robot, model, motion.posture(int(row))) for row in rows])
    try:
        pictures = film_strip.render_frames(robot, model, qpos)
    except film_strip.NoRendererError as error:
        raise BadInputError(f"no film strip: {error}") from error
    with staging(path.parent, (path.name,)) as folder:
        times = motion.time[rows] - motion.time[0]
        title = f"{motion.name}: {motion.strategy}"
        film_strip.save_strip(pictures, times, folder / path.name, title=title)


def _choose(robot: Robot, names: tuple[str, ...]) -> list[Keyframes]:
    from humanoid_getup.motions.build import KEYFRAMES, load_robot_keyframes

    with refusing():
        try:
            authored = {c.name: c for c in load_robot_keyframes(robot)}
        except (KeyError, TypeError, ValueError) as error:
            raise ValueError(f"{robot.folder / KEYFRAMES}: {error!r}") from error
        unknown = [name for name in names if name not in authored]
        if unknown:
            told = ", ".join(f"'{name}'" for name in unknown)
            raise ValueError(f"unknown motion {told}, expected {', '.join(authored)}")
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


def _print(rows: list[dict[str, Any]]) -> None:
    from rich.table import Table

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
    console_for(None).print(table)


def _format(value: Any, form: str) -> str:
    return format(value, form) if isinstance(value, int | float) else "?"
