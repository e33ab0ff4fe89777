"""LeRobot's side of the robot's process."""

from __future__ import annotations

import contextlib
import os
import socket
import subprocess
import sys
from multiprocessing.connection import Connection

from getup_server.messages import Act, Observe, Refusal, Setup, Snapshot

PROCESS = "getup_server.robot_process"
LONGEST_START = 120.0  # s, with a policy to load and ports to open
LONGEST_REPLY = 10.0  # s
LONGEST_END = 30.0  # s; the steps of a plan, between which it can be ended, take a few seconds
UNATTENDED = (
    ": servos with a bus watchdog stop by themselves, others hold: support the robot, and switch "
    "their power off"
)


class RobotUnreachableError(RuntimeError):
    """The robot cannot be opened, has stopped, or does not answer; the message says why."""


class RobotClient:
    """A robot in a process of its own."""

    def __init__(self, setup: Setup) -> None:
        """Start the process, and wait until the robot is open.

        Raises:
            RobotUnreachableError: if it cannot be opened.
        """
        ours, theirs = socket.socketpair()
        with theirs:
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-m", PROCESS, str(theirs.fileno())],
                env={**os.environ, "PYTHONPATH": os.pathsep.join(map(os.path.abspath, sys.path))},
                pass_fds=[theirs.fileno()],
                stdin=subprocess.DEVNULL,
                start_new_session=True,  # Ctrl-C is for this process, which ends it
            )
        self._is_real = setup.request.is_real
        self._owner = os.getpid()
        self._socket, self._connection = ours, Connection(os.dup(ours.fileno()))
        try:
            self.first = self._ask(setup, LONGEST_START)
        except BaseException:
            self.close()
            raise

    @property
    def pid(self) -> int:
        """Return the number of the process."""
        return self._process.pid

    @property
    def returncode(self) -> int | None:
        """Return how the process ended, 0 with torque off; None while it runs."""
        return self._process.poll()

    def act(self, targets: dict[str, float]) -> Snapshot:
        """Move joints to targets [rad]; return what is known once they were sent."""
        return self._ask(Act(targets=targets), LONGEST_REPLY)

    def observe(self) -> Snapshot:
        """Return what is known."""
        return self._ask(Observe(), LONGEST_REPLY)

    def close(self) -> None:
        """End the process, torque off; calling it twice is harmless.

        A forked child of the process that opened the robot only lets go of it.
        """
        self._hang_up()
        if os.getpid() != self._owner:
            return
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(LONGEST_END)
        self._process.kill()
        self._process.wait()

    def _hang_up(self) -> None:
        """End the connection, of which forked children of this process may have a copy."""
        if os.getpid() == self._owner:
            with contextlib.suppress(OSError):  # it has ended
                self._socket.shutdown(socket.SHUT_RDWR)
        self._socket.close()
        self._connection.close()

    def _ask(self, message: object, longest: float) -> Snapshot:
        if self._connection.closed:
            raise RobotUnreachableError(
                "the connection to the robot was closed, which switches torque off: disconnect, "
                "and connect again"
            )
        try:
            reply = self._exchange(message, longest)
        except BaseException:
            self._hang_up()  # a late reply would be taken for that to the next message
            raise
        if isinstance(reply, Refusal):
            raise RobotUnreachableError(reply.reason)
        if reply.ended:
            raise RobotUnreachableError(f"the robot has stopped: {reply.ended}")
        return reply

    def _exchange(self, message: object, longest: float) -> Snapshot | Refusal:
        """Send a message; return the reply."""
        try:
            self._connection.send(message)
            if not self._connection.poll(longest):
                raise RobotUnreachableError(
                    f"the process of the robot does not answer within {longest:g} s; the "
                    "connection is closed: torque goes off once the process runs again"
                )
            return self._connection.recv()
        except (EOFError, OSError) as error:
            raise RobotUnreachableError(self._explain_end()) from error

    def _explain_end(self) -> str:
        """Say that the process has ended, and what this means for the robot."""
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(LONGEST_REPLY)
        if self.returncode == 0:
            return "the process of the robot was asked to end: torque is off"
        return "the process of the robot has ended" + (UNATTENDED if self._is_real else "")
