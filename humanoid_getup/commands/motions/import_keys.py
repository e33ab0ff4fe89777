"""`getup motions import`: keys of another program's file, added to a robot's keyframes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Literal

from rich.console import Console
from rich.markup import escape
from tyro.conf import Positional, arg

from humanoid_getup.commands.command import command
from humanoid_getup.commands.errors import refusing
from humanoid_getup.commands.files import READ, check_file
from humanoid_getup.commands.inputs import load_robot
from humanoid_getup.commands.motions.build_motions import BuildRequest
from humanoid_getup.commands.options import CommandRequest, RobotOption, write_command
from humanoid_getup.motions.build import try_out
from humanoid_getup.motions.imported_keyframes import (
    ImportedKeyframes,
    guess_start,
    load_sequences,
    make_keyframes,
)
from humanoid_getup.motions.keyframes_file import KEYFRAMES
from humanoid_getup.motions.keyframes_writer import append_keyframes
from humanoid_getup.motions.trial import Trial
from humanoid_getup.progress.callback import ProgressMonitor
from humanoid_getup.scenes.scene import FLAT_SCENE
from humanoid_getup.simulation.world import World
from robots import Robot

MOST_PAGE = 255  # of an action file


@dataclass(frozen=True, kw_only=True)
class NewKeysOptions(CommandRequest):
    """Options for new keys."""

    start: Literal["supine", "prone", "left", "right", "squat", "standing"] | None = None
    """Posture class from which the keys start; default: the one from which they come nearest to a
    stand in simulation."""
    out: Annotated[Path | None, READ, arg(metavar="FILE")] = None
    """Keyframes file (.toml) to which the keys are added; default: the robot's keyframes.toml."""


@dataclass(frozen=True, kw_only=True)
class ImportKeysRequest(NewKeysOptions, RobotOption):
    """Add the keys of another program's file to the robot's keyframes.

    The file is a ROBOTIS action file (.bin), a JSON animation (.json) with keyframes of goals in
    degrees, or a table (.csv) with a column time and one for each joint.
    """

    file: Annotated[Positional[Path], READ, arg(metavar="FILE")]
    """File of another program: .bin, .json or .csv."""
    page: Annotated[tuple[int, ...], arg(metavar="N,...")] = ()
    """Pages of an action file; their following pages are played as well."""
    name: str = ""
    """Name of the motion; default: as in the file."""
    end: Literal["standing", "supine", "prone", "left", "right"] = "standing"
    """What the keys end in: a stand, or the side on which the robot lies."""
    clip: bool = False
    """Clip angles outside a joint's range to its ends instead of refusing them."""

    def _find_problems(self) -> Iterator[str]:
        yield from super()._find_problems()
        wrong = (page for page in self.page if not 1 <= page <= MOST_PAGE)
        yield from (f"--page is {page}, expected 1 to {MOST_PAGE}" for page in wrong)
        if self.name and len(self.page) > 1:
            yield f"--name is given with {len(self.page)} pages, expected one"


@dataclass(frozen=True, kw_only=True, eq=False)
class AddedKeys:
    """Keyframes that were added to a file."""

    robot: Robot
    file: Path
    imported: tuple[ImportedKeyframes, ...]
    trials: tuple[Trial, ...]
    """Outcome of each as it is, undisturbed and at full torque."""


@command("motions import")
def import_keys(request: ImportKeysRequest, monitor: ProgressMonitor) -> AddedKeys:
    """Read another program's file, find how the robot starts, and add the keys."""
    robot = load_robot(request)
    path = find_target(request, robot)
    with refusing():
        sequences = load_sequences(request.file, request.page, robot)
    imported = [
        make_keyframes(each, robot, name=request.name, end_class=request.end, clip=request.clip)
        for each in sequences
    ]
    return add_keys(imported, robot, request, path, monitor)


def find_target(request: NewKeysOptions, robot: Robot) -> Path:
    """Return the file to which new keys are added."""
    path = request.out or robot.folder / KEYFRAMES
    check_file(path)
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
    path.parent.mkdir(parents=True, exist_ok=True)
    append_keyframes(path, [trial.keyframes for trial in trials], robot)
    return AddedKeys(robot=robot, file=path, imported=tuple(imported), trials=tuple(trials))


def _try_out(found: ImportedKeyframes, robot: Robot, request: NewKeysOptions) -> Trial:
    world, keyframes = World(robot, FLAT_SCENE), found.keyframes
    if request.start is None:
        return guess_start(world, keyframes)
    return try_out(world, replace(keyframes, start_class=request.start))


@import_keys.show
def print_added(added: AddedKeys, request: NewKeysOptions, console: Console) -> None:
    """Print the added keyframes, their outcome, and the next step."""
    for found, trial in zip(added.imported, added.trials, strict=True):
        keyframes = trial.keyframes
        guessed = "given" if request.start else "guessed: --start says otherwise"
        console.print(
            f"[bold]{keyframes.name}[/]: {len(keyframes.keys)} keys, "
            f"{keyframes.duration.sum():.2f} s, from {keyframes.start_class} ({guessed})"
        )
        for note in found.notes:
            console.print(f" [yellow]![/] {escape(note)}")
        console.print(f" as they are, undisturbed at full torque: {escape(trial.describe())}")
    names = tuple(trial.keyframes.name for trial in added.trials)
    robot = request.robot if isinstance(request, RobotOption) else BuildRequest.robot
    following = write_command("motions build", BuildRequest(names=names, robot=robot))
    console.print(f"added to {added.file}; next: {following}", markup=False)
