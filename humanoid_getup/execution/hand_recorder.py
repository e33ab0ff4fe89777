"""Recording by hand: a person moves a limp robot, and a keypress stores each posture."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from enum import Enum

from drivers import Command, State
from drivers.terminal_keys import TerminalKeys
from robots import Robot
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


class TerminalPresses(TerminalKeys):
    """Presses on a terminal, inside a ``with`` block; other keys are ignored."""

    def __init__(self, terminal: int | None = None) -> None:
        """Prepare to watch a terminal, by file descriptor; ``None`` for standard input."""
        super().__init__(self._note, terminal)
        self._waiting: deque[Press] = deque()

    def poll(self) -> Press | None:
        """Return the next press; ``None`` if there is none yet."""
        return self._waiting.popleft() if self._waiting else None

    def _note(self, sent: bytes) -> None:
        if sent in PRESSES:
            self._waiting.append(PRESSES[sent])


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
