"""Adds keys of another program's file or of a recording to a robot's keyframes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from humanoid_getup.commands.errors import BadInputError, needing, refusing
from humanoid_getup.commands.inputs import load_robot
from humanoid_getup.commands.output_files import find_file_problems
from humanoid_getup.jobs.requests.motions import ImportKeysRequest, NewKeysOptions
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
from humanoid_getup.progress.callback import Cancel, ProgressMonitor, Report
from humanoid_getup.scenes.scene import FLAT_SCENE
from humanoid_getup.simulation.world import World
from robots import Robot


@dataclass(frozen=True, kw_only=True, eq=False)
class AddedKeys:
    """Keyframes that were added to a file."""

    robot: Robot
    file: Path
    imported: tuple[ImportedKeyframes, ...]
    trials: tuple[Trial, ...]
    """Outcome of each as it is, undisturbed and at full torque."""


def import_keys(
    request: ImportKeysRequest, report: Report | None = None, cancel: Cancel | None = None
) -> AddedKeys:
    """Read another program's file, find how the robot starts, and add the keys.

    Raises:
        BadInputError: if the file cannot be used.
        CancelledError: if ``cancel`` ended it; then no key is added.
    """
    ImportKeysRequest.accept(request)
    robot = load_robot(request)
    path = find_target(request, robot)
    with refusing(), needing("ros"):
        sequences = load_sequences(request.file, request.page, robot)
        imported = [
            make_keyframes(each, robot, name=request.name, end_class=request.end, clip=request.clip)
            for each in sequences
        ]
    return add_keys(imported, robot, request, path, ProgressMonitor(report, cancel))


def find_target(request: NewKeysOptions, robot: Robot) -> Path:
    """Return the file to which new keys are added."""
    path = request.out or robot.folder / KEYFRAMES
    if problems := find_file_problems(path):
        raise BadInputError("; ".join(problems))
    return path


def add_keys(
    imported: Sequence[ImportedKeyframes],
    robot: Robot,
    request: NewKeysOptions,
    path: Path,
    monitor: ProgressMonitor,
) -> AddedKeys:
    """Play new keyframes from their start, and add them to a file."""
    trials = []
    for each in imported:
        monitor.begin(f"playing {each.keyframes.name}")
        trials.append(_try_out(each, robot, request))
    monitor.check()
    with refusing():
        path.parent.mkdir(parents=True, exist_ok=True)
        append_keyframes(path, [trial.keyframes for trial in trials], robot)
    return AddedKeys(robot=robot, file=path, imported=tuple(imported), trials=tuple(trials))


def _try_out(found: ImportedKeyframes, robot: Robot, request: NewKeysOptions) -> Trial:
    world, keyframes = World(robot, FLAT_SCENE), found.keyframes
    if request.start is None:
        return guess_start(world, keyframes)
    return try_out(world, replace(keyframes, start_class=request.start))
