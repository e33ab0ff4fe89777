"""Import published model files; say what was found and whether the stance holds.

    python benchmarks/import_models.py FOLDER --pictures FOLDER

`models.txt` in the folder lists the models, one a line, each with what has to be said of it, as on
the command line of `getup robots import`:

    nao/nao.urdf --fix LHand,RHand

Without it, every `.xml` and `.urdf` file at the top of the folder is imported. A stance holds if
the robot, placed in it with its servos at its angles, stands for 3 s on the twin without feedback.
"""

from __future__ import annotations

import shlex
import tempfile
import time
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import tyro

import humanoid_getup as hg
from humanoid_getup.commands.parsing import registry
from humanoid_getup.commands.robot.import_robot import ImportRequest
from humanoid_getup.experiments.disturbances import Scenarios
from humanoid_getup.experiments.judging.outcome import Outcome
from humanoid_getup.experiments.judging.standing import HOLD_TIME
from humanoid_getup.experiments.rollouts import play
from humanoid_getup.reporting.film_strip import render_frames, save_sheet
from robots.kinematics import place
from robots.model_import.importer import ImportedRobot, ImportOptions, import_model
from robots.model_import.robot_folder import write_robot
from robots.model_import.source import ModelImportError

LIST = "models.txt"
SETTLING = 1.5  # s in which a robot may sway before its stand begins
SIDES = (180.0, 150.0, 270.0)  # deg, of the camera
KINDS = (".xml", ".urdf")
COLUMNS = ("model", "said", "joints", "pairs", "kg", "height m", "head", "servos", "stance", "s")


@dataclass(frozen=True, kw_only=True)
class Options:
    """Import the models of a folder."""

    folder: tyro.conf.Positional[Path]
    pictures: Path | None = None
    """Folder for a picture of each robot: placed in its stance, and at the end of the hold."""


def list_models(folder: Path) -> list[ImportRequest]:
    """List what to import: the lines of models.txt, else the model files of the folder."""
    if (folder / LIST).is_file():
        lines = (folder / LIST).read_text("utf-8").splitlines()
        calls = [shlex.split(line, comments=True) for line in lines]
    else:
        calls = [[f.name] for f in sorted(folder.iterdir()) if f.suffix.lower() in KINDS]
    return [
        tyro.cli(
            ImportRequest,
            args=[str(folder / call[0]), "--out", "unused", *call[1:]],
            registry=registry,
        )
        for call in calls
        if call
    ]


def hold(world: hg.World) -> Outcome:
    """Let a robot stand in its stance, its servos at its angles."""
    robot = world.robot
    start = place(robot, world.model, robot.standing)
    cycles = round((HOLD_TIME + SETTLING) / robot.control_period)
    targets = np.tile(robot.standing.joint_pos, (1, cycles, 1))
    record = play(world, Scenarios.nominal(world, start), targets).take(0)
    return Outcome(record, robot)


def judge_stance(world: hg.World, outcome: Outcome) -> str:
    """Say whether the robot stood, else what broke its stand first."""
    stance = outcome.record.stance
    if outcome.stood:
        return "holds"
    share = stance.neck_height[-1] / world.robot.standing_neck_height
    touch = ", touches the ground" if stance.non_foot_contact[-1] else ""
    return f"**falls**: {share:.0%} of its height, {np.degrees(stance.tilt[-1]):.0f}°{touch}"


def save_pictures(world: hg.World, outcome: Outcome, path: Path) -> None:
    """Save the stance from three sides, and the end of the hold."""
    start = place(world.robot, world.model, world.robot.standing)
    sides = [render_frames(world.robot, world.model, start[None], azimuth=a) for a in SIDES]
    end = render_frames(world.robot, world.model, outcome.qpos[-1:], azimuth=SIDES[1])
    save_sheet(np.concatenate([*sides, end]), ["front", "oblique", "left", "end"], path)


def try_model(call: ImportRequest, folder: Path, pictures: Path | None) -> list[str]:
    """Import a model, hold its stance; return its row of the table."""
    said = " ".join([*(f"--servo {s}" for s in call.servo), *(f"--fix {j}" for j in call.fix)])
    title = call.model.relative_to(folder).as_posix()
    options = ImportOptions(name="robot", servos=call.servo, fixed=call.fix)
    begin = time.perf_counter()
    try:
        found = import_model(call.model, options)
    except ModelImportError as fault:
        return [title, said, f"refused: {'; '.join(fault.problems)}", *[""] * (len(COLUMNS) - 3)]
    seconds = time.perf_counter() - begin
    with tempfile.TemporaryDirectory() as place_of_robot:
        write_robot(found, Path(place_of_robot) / "robot")
        world = hg.World(hg.load_robot(Path(place_of_robot) / "robot"))
    trace = hold(world)
    if pictures is not None:
        save_pictures(world, trace, pictures / f"{title.replace('/', '_')}.png")
    return [title, said, *describe(found, world), judge_stance(world, trace), f"{seconds:.1f}"]


def describe(found: ImportedRobot, world: hg.World) -> list[str]:
    """Describe what was found in a model: joints, pairs, mass, neck height, head, servos."""
    types = Counter(found.servos.types)
    return [
        str(len(found.joints)),
        str(sum(k != mirror for k, mirror in enumerate(found.mirror)) // 2),
        f"{world.model.body_mass.sum():.2f}",
        f"{world.robot.standing_neck_height:.2f}",
        str(found.segments.count("head")),
        ", ".join(f"{count} {name}" for name, count in types.items()),
    ]


def main(options: Options) -> None:
    """Import all models, and print the table."""
    if options.pictures is not None:
        options.pictures.mkdir(parents=True, exist_ok=True)
    print(f"| {' | '.join(COLUMNS)} |\n|{'---|' * len(COLUMNS)}")
    for call in list_models(options.folder):
        row = try_model(call, options.folder, options.pictures)
        print(f"| {' | '.join(row)} |", flush=True)


if __name__ == "__main__":
    main(tyro.cli(Options))
