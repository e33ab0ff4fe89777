"""`getup motions record`: a person moves a limp robot from key to key."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from enum import Enum

from rich.markup import escape
from tyro.conf import Positional

from drivers import Command, SafetyGuard, State
from drivers.control_loop import Ending, RunReport, run
from drivers.safety_limits import GuardLimits
from drivers.terminal_keys import TerminalKeys
from humanoid_getup.commands.backends import open_backend
from humanoid_getup.commands.command import program
from humanoid_getup.commands.console import console_for, showing
from humanoid_getup.commands.errors import DID_IT, DID_NOT_STAND, HARDWARE_FAULT
from humanoid_getup.commands.inputs import load_world
from humanoid_getup.commands.motions.import_keys import (
    NewKeysOptions,
    add_keys,
    find_target,
    print_added,
)
from humanoid_getup.commands.options import ViewOptions
from humanoid_getup.commands.viewer import viewing
from humanoid_getup.motions.imported_keyframes import find_travel_time, make_keyframes
from humanoid_getup.motions.key_files import KeyCollector, KeySequence
from humanoid_getup.motions.keyframes_file import load_keyframes
from humanoid_getup.motions.motion import NAME
from humanoid_getup.progress.callback import ProgressMonitor
from humanoid_getup.simulation.world import World
from robots import FULL_TORQUE, Robot
from robots.quaternion import Array

FRESH = 0.1  # s; angles that are older may be those of another posture


class Press(Enum):
    """Actions of a person, by keys."""

    TAKE = "take the posture"
    UNDO = "drop the last one"
    FINISH = "finish"
    LEAVE = "leave without saving"


PRESSES = {
    b"\r": Press.TAKE,
    b"\n": Press.TAKE,
    b" ": Press.TAKE,
    b"\x7f": Press.UNDO,
    b"\x08": Press.UNDO,
    b"q": Press.FINISH,
    b"": Press.LEAVE,
}
"""Presses by what a terminal sends; nothing where it is gone."""


class HandRecorder:
    """A controller that keeps a robot limp and takes its joint angles when a key is pressed."""

    def __init__(
        self,
        robot: Robot,
        poll: Callable[[], Press | None],
        on_change: Callable[[int], None] = lambda _: None,
    ) -> None:
        """Prepare to record; ``on_change`` is called with the number of keys so far."""
        self._limp, self._poll, self._on_change = Command.limp(robot.n), poll, on_change
        self.keys: list[Array] = []
        """Recorded joint angles [rad], (n,) each."""
        self.done = False
        """Whether the person has finished."""
        self.is_kept = True
        """Whether the recording is to be saved."""

    def reset(self, state: State) -> None:
        """Start over."""
        del state
        self.keys.clear()
        self.done, self.is_kept = False, True

    def step(self, state: State) -> Command:
        """Handle the presses since the last measurement; keep every joint limp.

        While the angles are outdated, presses wait.
        """
        is_fresh = float(state.joint_age.max()) <= FRESH
        while is_fresh and not self.done and (press := self._poll()) is not None:
            if press is Press.TAKE:
                self.keys.append(state.joint_pos.copy())
            elif press is Press.UNDO and self.keys:
                self.keys.pop()
            self.done = press in (Press.FINISH, Press.LEAVE)
            self.is_kept = press is not Press.LEAVE
            self._on_change(len(self.keys))
        return self._limp


LONGEST = 3600.0  # s
KEYS = "Enter takes the posture, backspace drops the last one, q finishes"


@dataclass(frozen=True, kw_only=True)
class RecordMotion(NewKeysOptions, ViewOptions):
    """Record keys from a robot that is moved by hand, torque off.

    Enter or space takes the posture, backspace drops the last one, q finishes.
    """

    name: Positional[str]
    """Name of the new motion."""


@program("motions record")
def record(options: RecordMotion) -> int:
    """Record keys and add them to the keyframes; 1 if there are none to add."""
    world, console = load_world(options), console_for()
    robot = world.robot
    path = find_target(options, robot)
    if not NAME.fullmatch(options.name):
        raise ValueError(
            f"name '{options.name}': expected up to 100 letters, digits, '_', '-', '.'"
        )
    if path.exists() and options.name in [k.name for k in load_keyframes(path, robot)]:
        raise ValueError(f"{path}: motion '{options.name}' is there already, expected another")
    with open_presses() as poll:
        console.print(f"the robot is limp: support it. {KEYS}")
        recorder = HandRecorder(robot, poll, lambda count: console.print(f"{count} keys"))
        report = _run(recorder, options, world)
    if report.ending is Ending.INTERRUPTED:
        raise KeyboardInterrupt("nothing is saved")
    is_fault = report.ending is Ending.FAULT  # keys recorded until then are still valid
    if is_fault:
        console.print(f"[red]{escape(report.reason)}")
    if not recorder.keys or not (is_fault or (recorder.done and recorder.is_kept)):
        console.print("no keys: nothing is saved")
        return HARDWARE_FAULT if is_fault else DID_NOT_STAND
    found = make_keyframes(make_sequence(options.name, recorder.keys, robot), robot, clip=True)
    with showing() as report:
        added = add_keys([found], robot, options, path, ProgressMonitor(report))
    print_added(added, options, console)
    return HARDWARE_FAULT if is_fault else DID_IT


@contextmanager
def open_presses(terminal: int | None = None) -> Iterator[Callable[[], Press | None]]:
    """Watch a terminal, by default standard input; yield what returns the next press, if any."""
    waiting = deque[Press]()

    def note(sent: bytes) -> None:
        if sent in PRESSES:
            waiting.append(PRESSES[sent])

    with TerminalKeys(note, terminal) as keys:
        if not keys.has_terminal:
            raise ValueError("standard input is not a terminal: recording needs its keys")
        yield lambda: waiting.popleft() if waiting else None


def make_sequence(name: str, keys: list[Array], robot: Robot) -> KeySequence:
    """Make a sequence of joint angles [rad], (n,) each; times follow from their distances.

    The person's own timing is ignored: each posture is held until a key is pressed.
    """
    collector = KeyCollector(robot=robot)
    for before, key in zip([keys[0], *keys], keys, strict=False):
        collector.add(find_travel_time(before, key), dict(enumerate(key.tolist())))
    return collector.finish(name, "a recording by hand")


def _run(recorder: HandRecorder, options: RecordMotion, world: World) -> RunReport:
    """Keep the robot limp until the person has finished; a simulated one waits in real time."""
    limit = FULL_TORQUE.on(world.robot)
    with open_backend(replace(options, realtime=True), world, limit) as choice:
        guard = SafetyGuard(choice.backend, GuardLimits.of_limp(world.robot))
        with viewing(options, world, realtime=choice.realtime) as show:
            return run(
                recorder,
                guard,
                max_time=LONGEST,
                realtime=choice.realtime,
                on_cycle=show,
            )
