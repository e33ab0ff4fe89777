"""`getup motions retarget`: keys of another robot, improved where they rarely stand."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

from rich.console import Console
from tyro.conf import arg

from humanoid_getup.commands.command import command
from humanoid_getup.commands.errors import DID_IT, DID_NOT_STAND
from humanoid_getup.commands.files import ROBOT
from humanoid_getup.commands.inputs import find_keyframes, load_robot
from humanoid_getup.commands.motions.build_motions import (
    BuildRequest,
    BuiltMotions,
    build_all,
    check_folders,
    is_begun,
    keep,
    print_built,
)
from humanoid_getup.commands.options import RobotOption, write_command
from humanoid_getup.experiments.falls import CLASSES
from humanoid_getup.motions.build import SOUND, build_unimproved, motion_file
from humanoid_getup.motions.keyframes import Keyframes, KeyTransfer
from humanoid_getup.motions.keyframes_file import KEYFRAMES
from humanoid_getup.motions.keyframes_writer import append_keyframes
from humanoid_getup.motions.motion import STANDING
from humanoid_getup.motions.motion_database import MOTION_FOLDER
from humanoid_getup.progress.callback import ProgressMonitor
from robots import Robot


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
