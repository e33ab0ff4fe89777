"""`getup motions build`, `retarget`, `discover`, `import`, `preview`, and `getup mocap import`."""

from __future__ import annotations

import math
import shlex
from dataclasses import replace
from typing import Any

from rich.markup import escape

from humanoid_getup.commands.console import console_for, showing
from humanoid_getup.commands.exit_codes import DID_IT, DID_NOT_STAND
from humanoid_getup.commands.options import RobotOption, write_command
from humanoid_getup.commands.output import write_json
from humanoid_getup.commands.repeat import hinting_resume
from humanoid_getup.jobs.build_motions import BuiltMotions, is_begun
from humanoid_getup.jobs.build_motions import build_motions as build_all
from humanoid_getup.jobs.discover_motions import DiscoveredMotions
from humanoid_getup.jobs.discover_motions import discover_all as search_all
from humanoid_getup.jobs.discover_motions import is_begun as is_searched
from humanoid_getup.jobs.import_clip import import_clip as make_motion
from humanoid_getup.jobs.import_keys import AddedKeys, import_keys
from humanoid_getup.jobs.preview_motion import preview as play_keys
from humanoid_getup.jobs.requests.motions import (
    BuildRequest,
    ClipRequest,
    DiscoverRequest,
    ImportKeysRequest,
    NewKeysOptions,
    PreviewRequest,
    RetargetRequest,
)
from humanoid_getup.jobs.retarget_motions import retarget as transfer_all
from humanoid_getup.motions.mocap.retarget_clip import RetargetedClip
from humanoid_getup.motions.motion_database import name_robot

SLOWED = 1.005  # times its duration, from which a motion counts as slowed down


def preview(command: PreviewRequest) -> int:
    """Play the keys once and draw them; 0 if that ends as it should."""
    with showing() as report:
        found = play_keys(command, report)
    console, trial = console_for(), found.trial
    console.print(f"{trial.keyframes.name}, as it is: {escape(trial.describe())}")
    drawn = f"no film strip: {found.undrawn}" if found.undrawn else f"film strip in {found.picture}"
    console.print(drawn, markup=False)
    return DID_IT if trial.succeeded else DID_NOT_STAND


def build(command: BuildRequest) -> int:
    """Build the motions; report those that fail."""
    with hinting_resume("motions build", command, is_begun), showing() as report:
        return _print_built(build_all(command, report))


def retarget(command: RetargetRequest) -> int:
    """Transfer another robot's keys; return 0 if every motion stands."""
    with hinting_resume("motions retarget", command, is_begun), showing() as report:
        found = transfer_all(command, report)
    if found.improved is not None:
        _print_built(found.improved)
    elif found.wanting:
        following = BuildRequest(names=found.wanting, robot=command.robot)
        console_for().print(
            f"a rise needs a motion from each side; next: "
            f"{write_command('motions build', following)}",
            markup=False,
            soft_wrap=True,
        )
    if found.is_complete:
        following = f"getup rise --robot {shlex.quote(command.robot)} --from supine"
        console_for().print(f"next: {following}", markup=False, soft_wrap=True)
    return DID_IT if found.is_complete else DID_NOT_STAND


def _print_built(found: BuiltMotions) -> int:
    console, count = console_for(), len(found.built) + len(found.failures)
    console.print(f"built {len(found.built)} of {count} into {found.folder}", soft_wrap=True)
    for failure in found.failures:
        console.print(f"[red]not built:[/] {escape(failure)}", soft_wrap=True)
    return DID_NOT_STAND if found.failures else DID_IT


def discover(command: DiscoverRequest) -> int:
    """Search from each side; return 1 if a side has no motion."""
    with hinting_resume("motions discover", command, is_searched), showing() as report:
        found = search_all(command, report)
    for each in found:
        if len(found) > 1:
            console_for().print(f"{each.robot.name}:", markup=False)
        _print_discovered(each, command)
    return DID_NOT_STAND if any(each.wanting for each in found) else DID_IT


def _print_discovered(found: DiscoveredMotions, command: DiscoverRequest) -> None:
    console = console_for()
    if found.picture is not None:
        console.print(f"film strips in {found.picture}", markup=False)
    if found.wanting:
        console.print(f"no motion from: {', '.join(found.wanting)}", markup=False)
    for each in found.nearest:
        console.print(each.describe(), markup=False, soft_wrap=True)
    if following := _name_next(found, command):
        console.print(f"next: {following}", markup=False, soft_wrap=True)


def _name_next(found: DiscoveredMotions, command: DiscoverRequest) -> str:
    """Name the command after a discovery; empty if there is none."""
    if found.wanting and found.goes_on:
        return write_command("motions discover", replace(command, resume=True))
    if not found.motions:
        return ""
    return f"getup rise {name_robot(found.robot)} --from {found.motions[0].start_class}"


def import_motion(command: ImportKeysRequest) -> int:
    """Add the keys of a file, and print them."""
    with showing() as report:
        added = import_keys(command, report)
    print_added(added, command)
    return DID_IT


def print_added(added: AddedKeys, command: NewKeysOptions) -> None:
    """Print the added keyframes, their outcome, and the next step."""
    console = console_for()
    for found, trial in zip(added.imported, added.trials, strict=True):
        keyframes = trial.keyframes
        guessed = "given" if command.start else "guessed: --start says otherwise"
        console.print(
            f"[bold]{keyframes.name}[/]: {len(keyframes.keys)} keys, "
            f"{keyframes.duration.sum():.2f} s, from {keyframes.start_class} ({guessed})"
        )
        for note in found.notes:
            console.print(f" [yellow]![/] {escape(note)}")
        console.print(f" as they are, undisturbed at full torque: {escape(trial.describe())}")
    names = tuple(trial.keyframes.name for trial in added.trials)
    robot = command.robot if isinstance(command, RobotOption) else BuildRequest.robot
    following = write_command("motions build", BuildRequest(names=names, robot=robot))
    console.print(f"added to {added.file}; next: {following}", markup=False)


def import_clip(command: ClipRequest) -> int:
    """Retarget a clip, and print the deviation of the motion."""
    with showing(command) as report:
        found = make_motion(command, report)
    write_json(_describe(found), command)
    console = console_for(command)
    for line in _tell(found):
        console.print(escape(line), soft_wrap=True)
    robot_option = "" if command.robot == "op3" else f" --robot {command.robot}"
    console.print(
        f"written to {command.target}; next: getup play {command.target}{robot_option}",
        markup=False,
        soft_wrap=True,
    )
    return DID_IT


def _describe(found: RetargetedClip) -> dict[str, Any]:
    """Describe a motion made from a clip, and the deviation of its limbs, for JSON."""
    motion, deviation = found.motion, found.deviation
    limb, largest = deviation.largest
    return {
        "name": motion.name,
        "robot": motion.robot,
        "start_class": motion.start_class,
        "end_class": motion.end_class,
        "duration_s": motion.duration,
        "slowdown": found.slowdown,
        "deviation_mean_deg": math.degrees(deviation.mean),
        "deviation_max_deg": math.degrees(largest),
        "deviation_max_limb": limb,
        "deviation_deg": {
            name: {"mean": math.degrees(rows.mean()), "max": math.degrees(rows.max())}
            for name, rows in deviation.angle.items()
        },
        "bound_joints": deviation.bound,
    }


def _tell(found: RetargetedClip) -> list[str]:
    motion, deviation = found.motion, found.deviation
    limb, largest = deviation.largest
    lines = [
        f"{motion.name}: {motion.duration:.2f} s from {motion.start_class} to {motion.end_class}",
        f"limbs point {math.degrees(deviation.mean):.1f}° off the clip's on average, at most "
        f"{math.degrees(largest):.0f}° (the {limb.replace('_', ' ')})",
    ]
    if found.slowdown > SLOWED:
        lines.append(f"slowed down to {found.slowdown:.2f} times its duration: servos' speed")
    if deviation.bound:
        bound = sorted(deviation.bound.items(), key=lambda pair: -pair[1])
        listed = ", ".join(f"{joint} {share:.0%}" for joint, share in bound)
        lines.append(f"joints at an end of their range, share of the frames: {listed}")
    return lines
