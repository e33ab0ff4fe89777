"""`getup motions build` and `retarget`: motions from keyframes, a robot's own or another one's."""

from __future__ import annotations

import contextlib
import shlex
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Annotated

from rich.console import Console
from rich.markup import escape
from tyro.conf import Positional, arg

from humanoid_getup.commands.command import command
from humanoid_getup.commands.errors import DID_IT, DID_NOT_STAND, BadInputError, refusing
from humanoid_getup.commands.files import ROBOT, find_folder_problems
from humanoid_getup.commands.inputs import find_keyframes, load_robot
from humanoid_getup.commands.options import Count, EngineOptions, Prefer, RobotOption, write_command
from humanoid_getup.commands.pieces import make_worker_request, starting
from humanoid_getup.engines.executor import do_pieces
from humanoid_getup.engines.versions import checked
from humanoid_getup.experiments.falls import CLASSES
from humanoid_getup.motions.build import (
    SOUND,
    UNFINISHED,
    Build,
    build_motion,
    build_unimproved,
    make_task,
    motion_file,
    unfinished_file,
)
from humanoid_getup.motions.keyframes import Keyframes, KeyTransfer
from humanoid_getup.motions.keyframes_file import KEYFRAMES
from humanoid_getup.motions.keyframes_writer import (
    append_keyframes,
    replace_keyframes,
    save_keyframes,
)
from humanoid_getup.motions.motion import STANDING
from humanoid_getup.motions.motion_database import MOTION_FOLDER
from humanoid_getup.progress.callback import Progress, ProgressMonitor
from humanoid_getup.progress.ledger import Ledger
from humanoid_getup.progress.worker import report
from humanoid_getup.reporting.film_strip import NoRendererError, draw_motion
from robots import Robot
from robots.storage.validation import between

MOST_CMA_SEED = 2**31
LOG, BEST, KEYS, STRIP = ".jsonl", ".npz", ".toml", ".png"
"""Files of an unfinished motion: search log, best try, keys, picture."""


@dataclass(frozen=True, kw_only=True)
class BuildRequest(EngineOptions, RobotOption):
    """Build rising motions from keyframes into the robot's folder."""

    names: Positional[tuple[str, ...]] = ()
    """Motions to build; default: all of the robot's keyframes."""
    generations: Count = 20
    """Generations of the search that optimizes the keyframes."""
    seed: Annotated[int, between(0, MOST_CMA_SEED), arg(help="Random seed.")] = 0
    prefer: Prefer | None = None
    """What a motion should be besides successful; default: as in its keyframes."""
    resume: bool = False
    """Continue searches that were interrupted, or that need more generations: see the folder
    unfinished of the robot."""
    keep_keys: bool = False
    """Write the optimized keys of motions that are built back into the keyframes."""


@dataclass(frozen=True, kw_only=True)
class BuiltMotions:
    """Result of building keyframes."""

    folder: Path
    """Folder of the motions."""
    built: tuple[str, ...]
    failures: tuple[str, ...]
    """Reasons why others failed, each with the place of the best try."""


def is_begun(request: BuildRequest) -> bool:
    """Return whether there is a stored search of a motion of a request."""
    folder = load_robot(request).folder / UNFINISHED
    kept = [path.stem for path in folder.glob(f"*{LOG}")]
    return bool(set(kept) & set(request.names or kept))


@command("motions build", is_begun=is_begun)
def build_motions(request: BuildRequest, monitor: ProgressMonitor) -> BuiltMotions:
    """Build motions into the robot's folder, and continue interrupted searches if requested."""
    robot = load_robot(request)
    check_folders(robot)
    return build_all(robot, find_keyframes(robot, request.names), request, monitor)


@build_motions.show
def print_built(found: BuiltMotions, _: BuildRequest, console: Console) -> int:
    """Print where motions were built, and why others failed; return the exit code."""
    count = len(found.built) + len(found.failures)
    console.print(f"built {len(found.built)} of {count} into {found.folder}", soft_wrap=True)
    for failure in found.failures:
        console.print(f"[red]not built:[/] {escape(failure)}", soft_wrap=True)
    return DID_NOT_STAND if found.failures else DID_IT


def check_folders(robot: Robot) -> None:
    """Refuse a robot in whose folder nothing can be written."""
    folders = (robot.folder / MOTION_FOLDER, robot.folder / UNFINISHED)
    if problems := [text for folder in folders for text in find_folder_problems(folder, ())]:
        raise BadInputError(*problems)


def build_all(
    robot: Robot, chosen: Sequence[Keyframes], request: BuildRequest, monitor: ProgressMonitor
) -> BuiltMotions:
    """Build motions on the engine of a request, and store each when it is ready."""
    _check_logs(robot, chosen, request, monitor)
    failures: dict[str, str] = {}

    def end(name: str, build: Build | str) -> None:
        if isinstance(build, str):
            failures[name] = build
            return
        try:
            failure = keep(build, robot, keep_keys=request.keep_keys)
        except (RuntimeError, ValueError, OSError) as error:  # disk full...
            failure = f"{name}: {error}"
        if failure:
            failures[name] = failure

    shared = make_worker_request(BuildRequest, request, robot=str(robot.folder))
    try:
        with (
            refusing(),  # errors of workers have no traceback
            starting(request, len(chosen), worth=1) as executor,
        ):
            pieces = {each.name: each for each in chosen}
            for name in pieces:
                monitor.show(Progress(phase=name, total=request.generations))
            # Builds write into the folder of their robot: it is no version.
            build = checked(partial(build_piece, shared), executor)
            do_pieces(build, pieces, executor, ended=end, monitor=monitor)
    finally:
        with contextlib.suppress(OSError):  # it is not empty, or not there
            (robot.folder / UNFINISHED).rmdir()
    return BuiltMotions(
        folder=robot.folder / MOTION_FOLDER,
        built=tuple(each.name for each in chosen if each.name not in failures),
        failures=tuple(failures.values()),
    )


def open_log(robot: Robot, keyframes: Keyframes, request: BuildRequest) -> Ledger:
    """Open the log of a search: the existing one to resume, else a new one."""
    path = unfinished_file(robot.folder, keyframes.name, LOG)
    task = make_task(robot, keyframes, request.seed, request.prefer)
    return Ledger.resume(path, task) if request.resume else Ledger(path, task)


def keep(build: Build, robot: Robot, *, keep_keys: bool) -> str:
    """Store a motion, or the best try of a failed one; return the reason and the place then."""
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
    """Store the best try of a motion that failed; return its file."""
    files = {s: unfinished_file(robot.folder, build.motion.name, s) for s in (BEST, KEYS, STRIP)}
    files[BEST].parent.mkdir(exist_ok=True)
    build.motion.save(files[BEST])
    save_keyframes(files[KEYS], [build.keyframes], robot)
    try:
        draw_motion(robot, build.motion, files[STRIP])
    except NoRendererError:
        return files[BEST]  # there is no strip without a GL
    return files[STRIP]


def _check_logs(
    robot: Robot, keyframes: Sequence[Keyframes], request: BuildRequest, monitor: ProgressMonitor
) -> None:
    """Check the logs before any work, and report the generations in them."""
    for each in keyframes:
        count = len(open_log(robot, each, request).done)
        begins = f"continues after generation {count}" if count else "begins: there is no log of it"
        if request.resume:
            monitor.tell(f"{each.name} {begins}")


def build_piece(request: BuildRequest, keyframes: Keyframes) -> Build | str:
    """Build a motion, in a worker, with its log in the robot's folder; return why that fails."""
    robot = load_robot(request)

    def tell(generation: int, cost: float, stood: float) -> None:
        report(
            Progress(
                phase=keyframes.name,
                done=generation + 1,
                total=request.generations,
                note=f"cost {cost:.2f}, {stood:.0%} stood",
            )
        )

    try:
        return build_motion(
            robot,
            keyframes,
            generations=request.generations,
            seed=request.seed,
            prefer=request.prefer,
            report=tell,
            log=open_log(robot, keyframes, request),
        )
    except (RuntimeError, ValueError, OSError) as error:
        return f"{keyframes.name}: {error}"


@dataclass(frozen=True, kw_only=True)
class RetargetRequest(BuildRequest):
    """Transfer the keyframes of another robot: point the limbs the same way, keep the motions
    that stand, and improve those that rarely do as `getup motions build` does."""

    robot: Annotated[str, ROBOT] = field()
    """Robot to which the motions are added: a name, or a folder with a robot.toml."""
    source: Annotated[str, ROBOT, arg(metavar="NAME|DIR")] = "op3"
    """Robot whose keyframes are transferred."""
    improve: bool = True
    """Improve the motions that stand in less than 80 % of disturbed worlds, or not at all."""


@dataclass(frozen=True, kw_only=True)
class RetargetedMotions:
    """Result of retargeting another robot's keyframes."""

    known: tuple[str, ...]
    """Motions that the robot had already."""
    kept: tuple[str, ...]
    """Motions that stand as they are."""
    rest: tuple[str, ...]
    """Motions that do not."""
    wanting: tuple[str, ...]
    """Of the rest, one that rises from each side from which none stands."""
    improved: BuiltMotions | None
    """Result of improving the rest, and what stands in few disturbed worlds; None without."""

    @property
    def is_complete(self) -> bool:
        """Return whether every motion stands."""
        return set(self.rest) <= set(self.improved.built if self.improved else ())


@command("motions retarget", is_begun=is_begun)
def retarget(request: RetargetRequest, monitor: ProgressMonitor) -> RetargetedMotions:
    """Transfer the keys, keep the motions that stand, and improve those that rarely do.

    Motions that the robot has already stay as they are.
    """
    robot = load_robot(request)
    source = load_robot(RobotOption(robot=request.source))
    if source.folder.resolve() == robot.folder.resolve():
        raise ValueError(f"--source is {source.name}, the robot itself, expected another robot")
    check_folders(robot)
    wanted = _transfer(source, robot, request, monitor)
    known = [each.name for each in wanted if motion_file(robot.folder, each.name).exists()]
    if known:
        monitor.tell(f"kept as they are: {', '.join(known)}")
    new = [each for each in wanted if each.name not in known]
    shares = [_keep_if_standing(robot, each, request.seed, monitor) for each in new]
    rest = [each for each, share in zip(new, shares, strict=True) if share is None]
    weak = [each for each, share in zip(new, shares, strict=True) if (share or 0.0) < SOUND]
    improves = bool(weak) and request.improve
    if new:
        monitor.tell(f"{len(new) - len(rest)} of {len(new)} stand as they are")
    return RetargetedMotions(
        known=tuple(known),
        kept=tuple(each.name for each in new if each not in rest),
        rest=tuple(each.name for each in rest),
        wanting=_pick_wanting(rest, [each for each in wanted if each not in rest]),
        improved=build_all(robot, weak, request, monitor) if improves else None,
    )


@retarget.show
def _print(found: RetargetedMotions, request: RetargetRequest, console: Console) -> int:
    if found.improved is not None:
        print_built(found.improved, request, console)
    elif found.wanting:
        following = BuildRequest(names=found.wanting, robot=request.robot)
        console.print(
            f"a rise needs a motion from each side; next: "
            f"{write_command('motions build', following)}",
            markup=False,
            soft_wrap=True,
        )
    if found.is_complete:
        following = f"getup rise --robot {shlex.quote(request.robot)} --from supine"
        console.print(f"next: {following}", markup=False, soft_wrap=True)
    return DID_IT if found.is_complete else DID_NOT_STAND


def _pick_wanting(rest: Sequence[Keyframes], kept: Sequence[Keyframes]) -> tuple[str, ...]:
    """Pick a motion that rises for each side, mirrored ones alike, from which none is kept."""
    served = {_find_side(each) for each in kept}
    first: dict[str, str] = {}
    for each in rest:
        if (side := _find_side(each)) and side not in served:
            first.setdefault(side, each.name)
    return tuple(first.values())


def _find_side(keyframes: Keyframes) -> str:
    """Return from which side a motion rises, lateral for left and right; empty if from none."""
    side = keyframes.start_class
    if keyframes.end_class != STANDING or side not in CLASSES:
        return ""
    return "lateral" if side in ("left", "right") else side


def _transfer(
    source: Robot, robot: Robot, request: RetargetRequest, monitor: ProgressMonitor
) -> Sequence[Keyframes]:
    """Write the keys that the robot does not have yet; return all requested ones."""
    path = robot.folder / KEYFRAMES
    wanted = find_keyframes(source, request.names)
    known = {each.name for each in find_keyframes(robot, ())} if path.exists() else set()
    new = [each for each in wanted if each.name not in known]
    if new:
        monitor.begin("pointing the limbs")
        transfer = KeyTransfer.between(source, robot)
        append_keyframes(path, [transfer.transfer(each) for each in new], robot)
    monitor.tell(f"keys of {len(new)} motions of {source.name} written to {path}")
    return find_keyframes(robot, tuple(each.name for each in wanted))


def _keep_if_standing(
    robot: Robot, keyframes: Keyframes, seed: int, monitor: ProgressMonitor
) -> float | None:
    """Keep a motion that stands as it is; tell how it ended."""
    monitor.begin(f"playing {keyframes.name}")
    build = build_unimproved(robot, keyframes, seed)
    if build.failure:
        monitor.tell(build.failure)
        return None
    keep(build, robot, keep_keys=False)
    share = float(build.motion.provenance["disturbed_success"])
    monitor.tell(
        f"motion '{keyframes.name}' stands, in {share:.0%} of disturbed worlds: "
        f"{Path(MOTION_FOLDER) / keyframes.name}.npz"
    )
    return share
