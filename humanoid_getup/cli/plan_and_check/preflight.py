"""`getup preflight MOTION`: judge whether a motion may be played, before torque is on."""

from __future__ import annotations

from rich.console import Console
from rich.markup import escape

from humanoid_getup.cli.shared.console import console_for, make_table, showing
from humanoid_getup.cli.shared.exit_codes import DID_IT, DID_NOT_STAND
from humanoid_getup.cli.shared.output import write_json
from humanoid_getup.jobs.preflight_motion import preflight as judge
from humanoid_getup.jobs.requests.motions import PreflightRequest
from humanoid_getup.motions.motion import Motion
from humanoid_getup.playback.ending import describe_end
from humanoid_getup.playback.preflight import MotionVerdict, ReasonKind
from humanoid_getup.playback.preflight_rollout import MOST_RISES
from robots import Robot

HEADINGS = ("joint", "peak N·m", "of limit", "RMS N·m", "saturated s", "after °C")
SHOWN = 6  # joints in the table, the most loaded first


def preflight(command: PreflightRequest) -> int:
    """Check a motion; return 0 if it may be played, 1 if it is refused."""
    with showing(command) as report:
        found = judge(command, report)
    write_json(found.describe(), command)
    print_verdict(found.robot, found.motion, found.verdict, console_for(command))
    return DID_IT if found.passed else DID_NOT_STAND


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
