"""Live feed: publishes the newest cycle to followers, and passes their stop on."""

from __future__ import annotations

import contextlib
import os
import select
import socket
import threading
from collections.abc import Callable
from pathlib import Path

from drivers.control_loop import Cycle
from drivers.live_feed.messages import (
    STOP,
    SUFFIX,
    FeedFolderError,
    LiveHello,
    LiveSample,
    find_feeds_folder,
    send_message,
)
from drivers.socket_path import reaching
from robots import Robot

BEGUN = ".begun"  # suffix of a feed that cannot be followed yet
PERIOD = 1.0 / 30.0  # s between two samples to a follower
SLOWEST = 2.0  # s that a follower may need for a sample; one that hangs is no longer served


class LiveFeed:
    """A socket of this user's own, as a context manager; threads of its own serve it.

    The control loop only leaves its newest cycle here: it never waits for a follower.
    """

    def __init__(self, robot: Robot, stop: Callable[[str], None]) -> None:
        """Prepare; ``stop`` is called from a thread when a follower stops the robot."""
        self._hello, self._stop = LiveHello.of(robot), stop
        self.path = find_feeds_folder() / f"{robot.name}-{os.getpid()}{SUFFIX}"
        self._phase = ""
        self._newest: tuple[int, Cycle] | None = None  # with its number, counted from 1
        self._ended = threading.Event()
        self._senders: list[threading.Thread] = []
        self._listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)

    def show(self, cycle: Cycle) -> None:
        """Make a cycle the newest one."""
        number = 1 if self._newest is None else self._newest[0] + 1
        self._newest = number, cycle

    def note(self, phase: str) -> None:
        """Note what the program is doing from now on."""
        self._phase = phase

    def __enter__(self) -> LiveFeed:
        begun = self.path.with_suffix(BEGUN)
        begun.unlink(missing_ok=True)  # of a killed process with this number
        try:
            with reaching(begun) as address:
                self._listener.bind(address)
        except OSError as error:
            raise FeedFolderError(f"live feed {self.path}: {error.strerror}") from error
        self._listener.listen()
        begun.replace(self.path)  # who finds it can connect
        threading.Thread(target=self._accept, name="live feed", daemon=True).start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        with contextlib.suppress(OSError):
            self._listener.shutdown(socket.SHUT_RDWR)
        self._listener.close()
        self.path.unlink(missing_ok=True)
        for sender in self._senders:  # a program that ends now would cut the last cycle off
            sender.join(2.0 * SLOWEST)

    def _accept(self) -> None:
        while not self._ended.is_set():
            try:
                connection, _ = self._listener.accept()
            except OSError:  # closed
                return
            connection.settimeout(SLOWEST)
            sender = threading.Thread(target=self._send, args=(connection,), daemon=True)
            self._senders = [each for each in self._senders if each.is_alive()] + [sender]
            sender.start()
            threading.Thread(target=self._listen, args=(connection,), daemon=True).start()

    def _send(self, connection: socket.socket) -> None:
        """Send what is new, until the follower or the feed ends; the last cycle, too."""
        sent: tuple[int, str] | None = None
        with connection, contextlib.suppress(OSError):
            send_message(connection, self._hello)
            is_over = False
            while not is_over:
                is_over = self._ended.wait(PERIOD)
                if not select.select([], [connection], [], SLOWEST if is_over else 0.0)[1]:
                    continue  # a slow follower misses samples but the last, and keeps its stop
                newest, phase = self._newest, self._phase
                if newest is not None and sent != (newest[0], phase):
                    number, cycle = newest
                    send_message(connection, LiveSample.of(cycle, phase, number))
                    sent = number, phase

    def _listen(self, connection: socket.socket) -> None:
        """Stop the robot when a follower says so."""
        while not self._ended.is_set():
            try:
                received = connection.recv(1)
            except TimeoutError:
                continue
            except OSError:
                return
            if not received:
                return
            if received == STOP:
                self._stop("stopped from the live page")


def list_feeds() -> list[Path]:
    """List the feeds of this user's programs that run; remove those that were left behind."""
    found = sorted(find_feeds_folder().glob(f"*{SUFFIX}"))
    for path in found:
        if not _runs(path):
            path.unlink(missing_ok=True)
    return [path for path in found if path.exists()]


def find_feed(process: int) -> Path | None:
    """Find the feed of a process by its number; None if it has none yet."""
    return next((path for path in list_feeds() if path.stem.endswith(f"-{process}")), None)


def _runs(path: Path) -> bool:
    """Return whether the process that a feed is named after runs."""
    try:
        os.kill(int(path.stem.rpartition("-")[2]), 0)
    except (ValueError, ProcessLookupError):
        return False
    except PermissionError:  # the number was given to another user's process
        return False
    return True
