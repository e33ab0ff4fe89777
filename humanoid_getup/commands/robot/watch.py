"""`getup watch`: a limp robot is read while a person turns it by hand."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from rich.console import Console, Group
from rich.live import Live
from rich.markup import escape
from rich.table import Table
from tyro.conf import arg

from drivers import Command, Cycle, Ending, State
from drivers.control_loop import run
from drivers.safety_limits import GuardLimits
from humanoid_getup.commands.backends import CancellableGuard, open_backend
from humanoid_getup.commands.command import command, write_json
from humanoid_getup.commands.console import ProgressDisplay, console_for, make_table
from humanoid_getup.commands.errors import DID_IT, HARDWARE_FAULT
from humanoid_getup.commands.inputs import find_start, load_world
from humanoid_getup.commands.options import A_REAL_ROBOT, BodyOption, OriginOption, ViewOptions
from humanoid_getup.commands.prompt import QuitKey
from humanoid_getup.commands.viewer import viewing
from humanoid_getup.progress.callback import ProgressMonitor
from humanoid_getup.reporting.watched_robot import (
    WatchedJoint,
    WatchedRobot,
    WatchFigures,
    WatchReport,
    describe_torso,
    format_degrees,
)
from robots import FULL_TORQUE, Robot
from robots.storage.validation import between

WATCHING, RELEASED = "watching", "a person ended it"
SUPPORT = "torque goes off now, and stays off: support the robot"
RATE = 5.0  # tables per second
TURNING = 0.2  # rad/s above which a joint is highlighted: creeping limbs are slower
HEADINGS = ("joint", "°", "seen °", "range °", "A", "°C", "positive", "remark")
LEFT = ("joint", "positive", "remark")
HINT = "torque is off: turn one joint after the other; q ends it"


@dataclass(frozen=True, kw_only=True)
class WatchRequest(BodyOption, OriginOption, ViewOptions):
    """Read a limp robot while a person turns it by hand: torque goes off, and stays off.

    A simulated robot lies on its back, or as --from says; a real one is supported by a person.
    """

    seconds: Annotated[float | None, between(0.001, 1e6, "s"), arg(metavar="S")] = None
    """Time after which it ends [s], which is simulated as fast as possible without --realtime;
    default: when q is pressed, with a simulated robot at the pace of the clock."""

    def _find_problems(self) -> Iterator[str]:
        yield from super()._find_problems()
        if self.is_real:
            yield from self.refuse_body(A_REAL_ROBOT)

    @property
    def is_paced(self) -> bool:
        """Return whether cycles wait for the clock of the wall."""
        return self.is_realtime or self.seconds is None


@command("watch", json=True)
def watch(
    request: WatchRequest,
    monitor: ProgressMonitor,
    *,
    is_released: Callable[[], bool] = lambda: False,
    begin: Callable[[WatchedRobot], None] = lambda _: None,
) -> WatchReport:
    """Read a robot, torque off, until its time is up, it is released, or there is a fault.

    Args:
        request: The robot.
        monitor: Shows progress; may end it in every cycle.
        is_released: Ends it once it returns True; called in every cycle.
        begin: Called before the first cycle with what can be asked for figures meanwhile.
    """
    monitor.begin("loading")
    world = load_world(request)
    robot, watched = world.robot, WatchedRobot(world)
    if request.is_real:
        monitor.tell(SUPPORT)
    monitor.begin("opening the backend")
    # A twin needs no sensor, only its place.
    without_imu = (robot.imu_site if request.backend == "twin" else robot.imu_kind) is None
    limit = FULL_TORQUE.on(robot)
    with open_backend(request, world, limit, without_imu=without_imu) as choice:
        if choice.place is not None:
            rng = np.random.default_rng(request.seed)
            choice.place(find_start(world, request.origin or "supine", rng, monitor.tell).posture)
        guard = CancellableGuard(choice.backend, GuardLimits.of_limp(robot), monitor.check)
        with viewing(request, world, realtime=request.is_paced or choice.realtime) as show:

            def see(cycle: Cycle) -> None:
                watched.show(cycle)
                show(cycle)

            monitor.begin(WATCHING)
            begin(watched)
            done = run(
                LimpController(robot, is_released),
                guard,
                max_time=math.inf if request.seconds is None else request.seconds,
                realtime=request.is_paced,
                on_cycle=see,
            )
    return WatchReport(
        robot=robot.name,
        backend=request.backend,
        reason=RELEASED if done.ending is Ending.DONE else done.reason,
        by_fault=done.ending is Ending.FAULT,
        watched_s=done.duration,
        cycles=done.cycles,
        period_s=done.period,
        last=watched.look(),
    )


class LimpController:
    """Keeps every joint limp until the robot is released."""

    def __init__(self, robot: Robot, is_released: Callable[[], bool]) -> None:
        """Prepare; ``is_released`` is called in every cycle."""
        self._limp, self._is_released = Command.limp(robot.n), is_released

    @property
    def done(self) -> bool:
        """Return whether the robot is released."""
        return self._is_released()

    def reset(self, state: State) -> None:
        """Start over."""

    def step(self, state: State) -> Command:
        """Keep every joint limp."""
        del state
        return self._limp


@watch.lead
def _watch_at_terminal(options: Any) -> int:
    """Show the robot in a table until a person ends it."""
    console, key = console_for(options), QuitKey()
    display = ProgressDisplay(console)
    with ExitStack() as shown:
        shown.callback(display.stop)

        def begin(watched: WatchedRobot) -> None:
            display.stop()
            if console.is_terminal:
                shown.enter_context(_open_table(watched, console))

        shown.enter_context(key)
        done = watch(options, display.show, is_released=key.is_pressed, begin=begin)
    write_json(done, options)
    color = "red" if done.by_fault else "green"
    console.print(
        f"[bold {color}]{escape(done.robot)}[/]: watched for {done.watched_s:.1f} s in "
        f"{done.cycles} cycles: {escape(done.reason)}"
    )
    if done.last is not None:
        console.print(*_draw(done.last), sep="\n")
        for finding in done.last.findings:
            console.print(f" [yellow]![/] {escape(finding)}")
    return HARDWARE_FAULT if done.by_fault else DID_IT


def _open_table(watched: WatchedRobot, console: Console) -> Live:
    """Show a table that follows the robot, drawn by a thread of its own, and gone afterwards."""

    def draw() -> Group:
        figures = watched.look()
        return Group(f"[dim]{HINT}", *(_draw(figures) if figures else ()))

    return Live(
        console=console, get_renderable=draw, refresh_per_second=RATE, transient=True, screen=False
    )


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
