"""`getup servo jog`: servos moved by keys."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

from rich.console import Group
from rich.live import Live
from rich.table import Table

from drivers.control_loop import Ending, run
from drivers.service.servos.jog import JogController
from drivers.terminal_keys import TerminalKeys
from humanoid_getup.cli.options.servo import JogServos
from humanoid_getup.cli.robot.servo.amperes import ESTIMATE, is_estimated
from humanoid_getup.cli.robot.servo.opening import open_servos, print_end
from humanoid_getup.cli.shared.console import console_for, make_table
from humanoid_getup.cli.shared.exit_codes import DID_IT, DID_NOT_STAND, HARDWARE_FAULT
from humanoid_getup.jobs.errors import BadInputError
from robots import Robot

RATE = 5.0  # tables per second
STEPS = {b"\x1b[C": 1, b"\x1b[D": -1, b"\x1b[A": 5, b"\x1b[B": -5}
"""Steps of the keys right, left, up and down."""
KEY = re.compile(rb"\x1b\[[A-D]|.", re.DOTALL)
KEYS = (
    "← → one step, ↑ ↓ five; n and p release it and choose another; q ends, any other key releases"
)


def jog(command: JogServos) -> int:
    """Move servos by keys until q is pressed."""
    console = console_for(command)
    servos = open_servos(command, console)
    if servos is None:
        return DID_NOT_STAND
    robot, step = servos.robot, math.radians(command.by)
    speed = math.radians(command.speed)
    controller = JogController(robot, speed=speed, torque_limit=servos.torque_limit)
    keys = JogKeys(controller, servos.chosen, step)
    if not keys.has_terminal:
        raise BadInputError(
            "standard input is not a terminal: jog needs keys, getup servo move none"
        )
    guard = servos.make_guard()
    with (
        keys,
        Live(
            console=console,
            get_renderable=lambda: Group(f"[dim]{KEYS}", _tabulate(robot, controller)),
            refresh_per_second=RATE,
            transient=True,
        ),
    ):
        report = run(controller, guard, max_time=math.inf, realtime=True)
    print_end(report, console)
    return DID_IT if report.ending is Ending.DONE else HARDWARE_FAULT


class JogKeys(TerminalKeys):
    """Keys that move the servos of a controller, inside a ``with`` block."""

    def __init__(
        self,
        controller: JogController,
        chosen: Sequence[int],
        step: float,
        terminal: int | None = None,
    ) -> None:
        """Prepare to move some joints, given by their numbers, by a step [rad] a press."""
        super().__init__(self._press_all, terminal)
        self._controller, self._chosen, self._step = controller, chosen, step
        self._place = 0
        controller.choose(chosen[0])

    def _press_all(self, sent: bytes) -> None:
        """Take what a terminal sends at once: several keys where one is held down."""
        if not sent:  # the terminal is gone
            self._controller.end()
        for key in KEY.findall(sent):
            self._press(key)

    def _press(self, key: bytes) -> None:
        if key in STEPS:
            self._controller.nudge(STEPS[key] * self._step)
        elif key in (b"n", b"p"):
            self._place = (self._place + (1 if key == b"n" else -1)) % len(self._chosen)
            self._controller.choose(self._chosen[self._place])
        elif key == b"q":
            self._controller.end()
        else:
            self._controller.release()


def _tabulate(robot: Robot, controller: JogController) -> Table:
    table = make_table(("joint", "id", "°", "wanted °", "A", "°C"), left=["joint"])
    if any(map(is_estimated, robot.joints)):
        table.caption = f"~ {ESTIMATE}"
    state = controller.state
    if state is None:
        return table
    for i, joint in enumerate(robot.joints):
        is_chosen = i == controller.joint
        wanted = controller.wanted if is_chosen else None
        table.add_row(
            joint.name,
            str(joint.servo.id),
            f"{math.degrees(state.joint_pos[i]):+.1f}",
            "limp" if wanted is None else f"{math.degrees(wanted):+.1f}",
            f"{'~' if is_estimated(joint) else ''}{state.joint_current[i] + 0.0:.2f}",
            f"{state.temperature[i]:.0f}",
            style="bold cyan" if is_chosen else None,
        )
    return table
