"""`getup motions import`: keys from elsewhere are added to a robot's keyframes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from rich.markup import escape

from humanoid_getup.cli.errors import BadInputError, refusing
from humanoid_getup.cli.exit_codes import DID_IT
from humanoid_getup.cli.inputs import load_robot
from humanoid_getup.cli.options.own_motions import ImportMotion, RecordMotion
from humanoid_getup.cli.output import console_for, find_file_faults, phase
from humanoid_getup.motions.build import try_out
from humanoid_getup.motions.importing.imported_keyframes import (
    ImportedKeyframes,
    guess_start,
    load_sequences,
    make_keyframes,
)
from humanoid_getup.motions.keyframes_file import KEYFRAMES
from humanoid_getup.motions.keyframes_writer import append_keyframes
from humanoid_getup.motions.trial import Trial
from humanoid_getup.scenes.scene import FLAT_SCENE
from humanoid_getup.simulation.world import World
from robots import Robot

NewKeys = ImportMotion | RecordMotion


def import_motion(command: ImportMotion) -> int:
    """Read the file, find how the robot starts, and add the keys."""
    robot = load_robot(command)
    path = find_target(command, robot)
    with refusing():
        sequences = load_sequences(command.file, command.page, robot)
        imported = [
            make_keyframes(
                sequence,
                robot,
                name=command.name,
                end_class=command.end,
                clip=command.clip,
            )
            for sequence in sequences
        ]
    add(imported, robot, command, path)
    return DID_IT


def find_target(command: NewKeys, robot: Robot) -> Path:
    """Return the file to which new keys are added.

    Raises:
        BadInputError: if it cannot be written.
    """
    path = command.out or robot.folder / KEYFRAMES
    if faults := find_file_faults(path):
        raise BadInputError("; ".join(faults))
    return path


def add(imported: Sequence[ImportedKeyframes], robot: Robot, command: NewKeys, path: Path) -> None:
    """Play new keyframes from where they start, add them to a file, and say what they are."""
    with phase("playing the keys"):
        trials = [_try_out(found, robot, command) for found in imported]
    with refusing():
        append_keyframes(path, [trial.keyframes for trial in trials], robot)
    console = console_for(None)
    for found, trial in zip(imported, trials, strict=True):
        keyframes = trial.keyframes
        guessed = "given" if command.start else "guessed: --start says otherwise"
        console.print(
            f"[bold]{keyframes.name}[/]: {len(keyframes.keys)} keys, "
            f"{keyframes.duration.sum():.2f} s, from {keyframes.start_class} ({guessed})"
        )
        for note in found.notes:
            console.print(f" [yellow]![/] {escape(note)}")
        console.print(f" as they are, undisturbed at full torque: {escape(trial.describe())}")
    names = " ".join(trial.keyframes.name for trial in trials)
    console.print(f"added to {escape(str(path))}; next: getup motions build {names}", end="")
    console.print(f" --robot {escape(command.robot)}" if command.robot != robot.name else "")


def _try_out(found: ImportedKeyframes, robot: Robot, command: NewKeys) -> Trial:
    world, keyframes = World(robot, FLAT_SCENE), found.keyframes
    if command.start is None:
        return guess_start(world, keyframes)
    return try_out(world, replace(keyframes, start_class=command.start))
