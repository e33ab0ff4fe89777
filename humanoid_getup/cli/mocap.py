"""`getup mocap import`: a clip of motion capture becomes a motion of a robot."""

from __future__ import annotations

import math
from typing import Any

from rich.markup import escape

from humanoid_getup.cli.errors import refusing
from humanoid_getup.cli.exit_codes import DID_IT
from humanoid_getup.cli.inputs import load_robot
from humanoid_getup.cli.options.mocap import ImportClip
from humanoid_getup.cli.output import console_for, phase, to_json, write_json
from humanoid_getup.clips.clip_file import read_clip
from humanoid_getup.motions.mocap.retarget_clip import ClipRetargeter, RetargetedClip


def import_clip(command: ImportClip) -> int:
    """Retarget the clip, write the motion, and say how far it is from the clip."""
    robot = load_robot(command)
    with phase("reading") as tell, refusing():
        clip = read_clip(command.clip, command.skeleton, command.rate, command.up)
        found = ClipRetargeter(robot).retarget(
            clip,
            name=command.motion_name,
            begin=command.begin or 0.0,
            end=math.inf if command.end is None else command.end,
            finish=command.finish,
            report=lambda share: tell(f"pointing the limbs: {share:.0%}"),
        )
        command.target.parent.mkdir(parents=True, exist_ok=True)
        found.motion.save(command.target)
    write_json(to_json(_describe(found)), command.json)
    console = console_for(command.json)
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
    if found.slowdown > 1.005:
        lines.append(f"slowed down to {found.slowdown:.2f} times its duration: servos' speed")
    if deviation.bound:
        bound = sorted(deviation.bound.items(), key=lambda pair: -pair[1])
        listed = ", ".join(f"{joint} {share:.0%}" for joint, share in bound)
        lines.append(f"joints at an end of their range, share of the frames: {listed}")
    return lines
