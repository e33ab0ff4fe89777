"""The mailbox between the thread that moves the robot and the one that answers LeRobot."""

from __future__ import annotations

import threading
import time
from dataclasses import replace

from getup_server.messages import Snapshot
from robots.quaternion import Array

LONGEST_CYCLE = 5.0  # s that an action may wait for the cycle that sends it; the first switches on


class Mailbox:
    """Holds the newest action and what is known of the robot."""

    def __init__(self, snapshot: Snapshot) -> None:
        """Begin with what is known of the robot."""
        self._changed = threading.Condition()
        self._snapshot = self._answer = snapshot
        self._action: dict[str, float] = {}
        self._posted = self._taken = self._answered = 0
        self._stopping = False
        self._heard_at = time.monotonic()

    # The side of LeRobot ------------------------------------------------------------------------

    @property
    def snapshot(self) -> Snapshot:
        """Return what is known of the robot."""
        return self._snapshot

    def observe(self) -> Snapshot:
        """Return what is known of the robot to LeRobot, whose process is alive."""
        self._heard_at = time.monotonic()
        return self._snapshot

    def post(self, targets: dict[str, float]) -> Snapshot:
        """Leave targets [rad] by joints; return what is known after the cycle that sent them.

        While the robot rises, the answer comes at once, and the targets are dropped.
        """
        with self._changed:
            self._heard_at = time.monotonic()
            if self._snapshot.rising:
                return self._snapshot
            self._action = self._action | targets
            self._posted += 1
            number = self._posted
            self._changed.notify_all()
            self._changed.wait_for(lambda: self._answered >= number or self._is_away, LONGEST_CYCLE)
            return self._answer if self._answered >= number else self._snapshot

    @property
    def _is_away(self) -> bool:
        """Return whether no cycle will answer an action."""
        return self._snapshot.rising or bool(self._snapshot.ended) or self._stopping

    def stop(self) -> None:
        """Ask the robot to end, torque off."""
        with self._changed:
            self._stopping = True
            self._changed.notify_all()

    # The side of the robot ----------------------------------------------------------------------

    def is_stopping(self) -> bool:
        """Return whether the robot is to end."""
        return self._stopping

    @property
    def silence(self) -> float:
        """Return the time since LeRobot's process sent a message [s]."""
        return time.monotonic() - self._heard_at

    def wait(self, seconds: float | None = None) -> bool:
        """Wait for the first action or the end; return whether one of them has come."""
        with self._changed:
            return self._changed.wait_for(lambda: self._posted > 0 or self._stopping, seconds)

    def wait_for_end(self) -> None:
        """Wait until the robot is to end."""
        with self._changed:
            self._changed.wait_for(self.is_stopping)

    def take(self) -> dict[str, float]:
        """Return the targets [rad] that were left since the last time, by joints."""
        with self._changed:
            action, self._action = self._action, {}
            self._taken = self._posted
            return action

    def measure(self, joint_pos: Array, targets: Array, gravity_b: Array, gyro_b: Array) -> None:
        """Publish a measurement and what was sent; this answers the actions that were taken."""
        with self._changed:
            self._snapshot = replace(
                self._snapshot,
                joint_pos=joint_pos,
                targets=targets,
                gravity_b=gravity_b,
                gyro_b=gyro_b,
            )
            if self._answered < self._taken:
                self._answered, self._answer = self._taken, self._snapshot
            self._changed.notify_all()

    def begin(self, phase: str, *, rising: bool) -> None:
        """Publish that a phase begins; one of a rise drops targets that wait."""
        with self._changed:
            if rising:
                self._action = {}
            self._snapshot = replace(self._snapshot, phase=phase, rising=rising)
            self._changed.notify_all()

    def end(self, reason: str) -> None:
        """Publish why torque went off, for good."""
        with self._changed:
            self._snapshot = replace(self._snapshot, phase="", rising=False, ended=reason)
            self._changed.notify_all()
