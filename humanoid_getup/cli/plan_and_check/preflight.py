"""`getup preflight MOTION`: judge whether a motion may be played, before torque is on."""

from __future__ import annotations

import math
from typing import Any

from rich.console import Console
from rich.markup import escape

from humanoid_getup.cli.options.motions import Preflight
from humanoid_getup.cli.shared.console import console_for, make_table, phase
from humanoid_getup.cli.shared.exit_codes import DID_IT, DID_NOT_STAND
from humanoid_getup.cli.shared.output import write_json
from humanoid_getup.jobs.errors import refusing
from humanoid_getup.jobs.inputs import find_motion, load_world, make_torque_limit
from humanoid_getup.motions.motion import Motion
from humanoid_getup.playback.ending import describe_end
from humanoid_getup.playback.preflight import MotionVerdict, ReasonKind
from humanoid_getup.playback.preflight import preflight as judge_motion
from humanoid_getup.playback.preflight_rollout import MOST_RISES
from robots import Robot

HEADINGS = ("joint", "peak N·m", "of limit", "RMS N·m", "saturated s", "after °C")
SHOWN = 6  # joints in the table, the most loaded first


def preflight(command: Preflight) -> int:
    """Check a motion; return 0 if it may be played, 1 if it is refused."""
    world = load_world(command)
    robot, motion = world.robot, find_motion(world.robot, command.motion)
    limit = make_torque_limit(command, robot)
    with phase("rolling out"), refusing():
        verdict = judge_motion(
            world,
            motion,
            voltage=robot.supply_voltage if command.voltage is None else command.voltage,
            torque_limit=limit,
            temperature=command.temperature,
        )
    about = {
        "robot": robot.name,
        "body": str(robot.body),
        "motion": motion.name,
        "scene": command.scene,
        "torque_limit_nm": limit.value,
        "limit_by": limit.by,
        "temperature_c": command.temperature,
    }
    write_json(about | record_verdict(robot, verdict), command)
    print_verdict(robot, motion, verdict, console_for(command))
    return DID_IT if verdict.passed else DID_NOT_STAND


def record_verdict(robot: Robot, verdict: MotionVerdict) -> dict[str, Any]:
    """Return a verdict as plain values, for JSON."""
    figures = verdict.figures
    return {
        "passed": verdict.passed,
        "reasons": [
            {"kind": reason.kind.value, "joint": reason.joint, "text": reason.text}
            for reason in verdict.reasons
        ],
        "voltage_v": figures.voltage,
        "duration_s": figures.duration,
        "succeeded": figures.succeeded,
        "stood": figures.succeeded and not math.isnan(figures.stand_time),
        "stand_time_s": figures.stand_time,
        "rises_in_a_row": figures.rises_in_a_row,
        "start_overlap_m": figures.start_overlap,
        "overlap_growth_m": figures.overlap_growth,
        "joints": {
            name: {
                "target_speed_rad_s": figures.target_speed[i],
                "peak_torque_nm": figures.peak_torque[i],
                "rms_torque_nm": figures.rms_torque[i],
                "torque_use": figures.torque_use[i],
                "saturation_s": figures.saturation[i],
                "longest_saturation_s": figures.longest_saturation[i],
                "end_temperature_c": figures.end_temperature[i],
            }
            for i, name in enumerate(robot.joint_names)
        },
    }


def print_verdict(robot: Robot, motion: Motion, verdict: MotionVerdict, console: Console) -> None:
    """Print the verdict, its reasons and the most loaded joints."""
    figures = verdict.figures
    word, color = ("passed", "green") if verdict.passed else ("refused", "red")
    console.print(f"[bold {color}]{escape(motion.name)}: {word} at {figures.voltage:.1f} V")
    for reason in verdict.reasons:
        mark = "[red]✗[/]" if reason.kind is ReasonKind.REFUSE else "[yellow]![/]"
        console.print(f" {mark} {escape(str(reason))}")
    rises = f"over {MOST_RISES}" if figures.rises_in_a_row is None else f"{figures.rises_in_a_row}"
    ending = f"{'ends' if figures.succeeded else 'does not end'} {describe_end(motion)}"
    if figures.succeeded and motion.rises:
        ending = f"stands after {figures.stand_time:.2f} s"
    console.print(f"rollout: {ending}; rises in a row until a servo is too hot: {rises}")
    table = make_table(HEADINGS, left=["joint"])
    for i in (-figures.torque_use).argsort()[:SHOWN]:
        table.add_row(
            robot.joint_names[i],
            f"{figures.peak_torque[i]:.2f}",
            f"{figures.torque_use[i]:.0%}",
            f"{figures.rms_torque[i]:.2f}",
            f"{figures.saturation[i]:.2f}",
            f"{figures.end_temperature[i]:.1f}",
        )
    console.print(table)
