"""`getup watch`: shows a limp robot while a person turns it by hand."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import ExitStack

from rich.console import Console, Group
from rich.live import Live
from rich.markup import escape
from rich.table import Table

from drivers.terminal_keys import TerminalKeys
from humanoid_getup.commands.console import ProgressDisplay, console_for, make_table
from humanoid_getup.commands.exit_codes import DID_IT, HARDWARE_FAULT
from humanoid_getup.commands.output import write_json
from humanoid_getup.jobs.get_up import watch as jobs
from humanoid_getup.jobs.requests.rise import WatchRequest
from humanoid_getup.reporting.watched_robot import (
    WatchedJoint,
    WatchedRobot,
    WatchFigures,
    WatchReport,
    describe_torso,
    format_degrees,
)

RATE = 5.0  # tables per second
TURNING = 0.2  # rad/s above which a joint is highlighted: creeping limbs are slower
HEADINGS = ("joint", "°", "seen °", "range °", "A", "°C", "positive", "remark")
LEFT = ("joint", "positive", "remark")
HINT = "torque is off: turn one joint after the other; q ends it"


def watch(command: WatchRequest) -> int:
    """Show a limp robot until a person ends it; return the exit code."""
    console, key = console_for(command), QuitKey()
    display = ProgressDisplay(console)
    with ExitStack() as shown:
        shown.callback(display.stop)

        def begin(watched: WatchedRobot) -> None:
            display.stop()
            if console.is_terminal:
                shown.enter_context(_open_table(watched, console))

        shown.enter_context(key)
        done = jobs.watch(command, display.show, is_released=key.is_pressed, begin=begin)
    write_json(done, command)
    _print(done, console)
    return HARDWARE_FAULT if done.by_fault else DID_IT


class QuitKey(TerminalKeys):
    """Key q of the terminal, or its end, inside a ``with`` block."""

    def __init__(self, terminal: int | None = None) -> None:
        """Prepare to watch a terminal, by file descriptor; ``None`` for standard input."""
        super().__init__(self._note, terminal)
        self._pressed = threading.Event()

    def is_pressed(self) -> bool:
        """Return whether the key was pressed."""
        return self._pressed.is_set()

    def wait(self, seconds: float) -> None:
        """Wait until the key is pressed, a time [s] at most."""
        self._pressed.wait(seconds)

    def _note(self, sent: bytes) -> None:
        if sent.lower() in (b"q", b""):
            self._pressed.set()


def _open_table(watched: WatchedRobot, console: Console) -> Live:
    """Show a table that follows the robot, drawn by a thread of its own, and gone afterwards."""

    def draw() -> Group:
        figures = watched.look()
        return Group(f"[dim]{HINT}", *(_draw(figures) if figures else ()))

    return Live(
        console=console, get_renderable=draw, refresh_per_second=RATE, transient=True, screen=False
    )


def _print(done: WatchReport, console: Console) -> None:
    color = "red" if done.by_fault else "green"
    console.print(
        f"[bold {color}]{escape(done.robot)}[/]: watched for {done.watched_s:.1f} s in "
        f"{done.cycles} cycles: {escape(done.reason)}"
    )
    if done.last is None:
        return
    console.print(*_draw(done.last), sep="\n")
    for finding in done.last.findings:
        console.print(f" [yellow]![/] {escape(finding)}")


def _draw(figures: WatchFigures) -> Iterator[str | Table]:
    """Draw the robot as lines and a table."""
    torque = "[bold red]on[/]" if figures.torque_on else "off"
    yield f"{figures.time_s:.1f} s, torque {torque}, {figures.voltage_v:.1f} V"
    yield describe_torso(figures.torso)
    table = make_table(HEADINGS, left=LEFT)
    for name, joint in figures.joints.items():
        style = "bold cyan" if abs(joint.speed_rad_s) > TURNING else None
        table.add_row(escape(name), *_list_cells(joint), style=style)
    yield table


def _list_cells(joint: WatchedJoint) -> list[str]:
    return [
        format_degrees(joint.angle_rad, 1),
        _format_span(joint.lowest_rad, joint.highest_rad),
        _format_span(joint.lower_rad, joint.upper_rad),
        f"{round(joint.current_a, 2) + 0.0:.2f}",
        f"{joint.temperature_c:.0f}",
        joint.positive,
        f"[yellow]{escape(', '.join(joint.remarks))}",
    ]


def _format_span(lowest: float, highest: float) -> str:
    return f"{format_degrees(lowest)} to {format_degrees(highest)}"
