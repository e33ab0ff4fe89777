"""`getup motions retarget`: the keys of another robot's motions, tried and improved on a robot."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from humanoid_getup.cli.building import build_rest, keep
from humanoid_getup.cli.errors import BadInputError, refusing
from humanoid_getup.cli.exit_codes import DID_IT, DID_NOT_STAND
from humanoid_getup.cli.inputs import find_keyframes, load_robot
from humanoid_getup.cli.options.motions import RetargetMotions
from humanoid_getup.cli.output import console_for, find_folder_faults, phase
from humanoid_getup.motions.build import UNFINISHED, build_unimproved, motion_file
from humanoid_getup.motions.key_transfer import KeyTransfer
from humanoid_getup.motions.keyframes import Keyframes
from humanoid_getup.motions.keyframes_file import KEYFRAMES
from humanoid_getup.motions.keyframes_writer import append_keyframes
from humanoid_getup.motions.motion_database import MOTION_FOLDER
from robots import Robot
from robots import load_robot as load


def retarget(command: RetargetMotions) -> int:
    """Transfer the keys, keep the motions that stand as they are, and improve the others.

    Motions that the robot has already stay as they are.
    """
    robot = load_robot(command)
    with refusing():
        source = load(command.source)
    if source.folder.resolve() == robot.folder.resolve():
        raise BadInputError(f"--source is {source.name}, the robot itself, expected another robot")
    for folder in (MOTION_FOLDER, UNFINISHED):
        if faults := find_folder_faults(robot.folder / folder, ()):
            raise BadInputError("; ".join(faults))
    console = console_for(None)
    chosen = _leave_out_known(_transfer(source, robot, command), robot)
    rest = [each for each in chosen if not _keep_if_sound(robot, each, command.seed, console)]
    if chosen:
        console.print(f"{len(chosen) - len(rest)} of {len(chosen)} stand as they are")
    if not rest or not command.improve:
        return DID_NOT_STAND if rest else DID_IT
    return build_rest(robot, rest, command)


def _transfer(source: Robot, robot: Robot, command: RetargetMotions) -> Sequence[Keyframes]:
    """Write the keys that the robot does not have yet; return all that were asked for."""
    path = robot.folder / KEYFRAMES
    wanted = find_keyframes(source, command.names)
    known = {each.name for each in find_keyframes(robot, ())} if path.exists() else set()
    new = [each for each in wanted if each.name not in known]
    if new:
        with refusing(), phase("pointing the limbs"):
            transfer = KeyTransfer.between(source, robot)
            append_keyframes(path, [transfer.transfer(each) for each in new], robot)
    console_for(None).print(f"keys of {len(new)} motions of {source.name} written to {path}")
    return find_keyframes(robot, tuple(each.name for each in wanted))


def _leave_out_known(chosen: Sequence[Keyframes], robot: Robot) -> list[Keyframes]:
    """Leave out keyframes whose motions are built."""
    known = [each.name for each in chosen if motion_file(robot.folder, each.name).exists()]
    if known:
        console_for(None).print(f"kept as they are: {', '.join(known)}", markup=False)
    return [each for each in chosen if each.name not in known]


def _keep_if_sound(robot: Robot, keyframes: Keyframes, seed: int, console: Console) -> bool:
    """Keep a motion that stands in most disturbed worlds as it is; tell how it ended."""
    with phase(f"playing {keyframes.name}"):
        build = build_unimproved(robot, keyframes, seed)
    if build.failure:
        console.print(build.failure, markup=False)
        return False
    keep(build, robot, keep_keys=False)
    share = float(build.motion.provenance["disturbed_success"])
    console.print(
        f"motion '{keyframes.name}' stands, in {share:.0%} of disturbed worlds: "
        f"{Path(MOTION_FOLDER) / keyframes.name}.npz",
        markup=False,
    )
    return True
