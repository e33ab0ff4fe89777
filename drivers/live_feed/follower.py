"""Follower: reads the live feed of another program, and may stop its robot."""

from __future__ import annotations

import contextlib
import socket
import threading
from collections.abc import Callable
from pathlib import Path

from drivers.live_feed.messages import STOP, FeedError, LiveHello, LiveSample, receive_message
from drivers.socket_path import reaching

CONNECT_WITHIN = 5.0  # s


class LiveFollower:
    """Calls back with every sample, in a thread of its own, until the feed ends."""

    def __init__(
        self,
        path: Path,
        on_sample: Callable[[LiveSample], None],
        on_end: Callable[[str], None] = lambda _: None,
    ) -> None:
        """Connect, and begin to read.

        Args:
            path: Socket of the feed.
            on_sample: Called with each sample.
            on_end: Called once when it ends, with a problem, or with "" if there is none.

        Raises:
            FeedError: if there is no feed, or it does not say whose it is.
        """
        self._on_sample, self._on_end = on_sample, on_end
        self._connection = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        try:
            self._connection.settimeout(CONNECT_WITHIN)
            with reaching(path) as address:
                self._connection.connect(address)
            hello = receive_message(self._connection, LiveHello)
        except OSError as error:
            self._connection.close()
            raise FeedError(f"live feed {path}: {error.strerror or error}") from error
        if hello is None:
            self._connection.close()
            raise FeedError(f"live feed {path}: it ended")
        self.hello = hello
        """Whose feed it is."""
        self._connection.settimeout(None)
        self._thread = threading.Thread(target=self._read, name="follower", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Stop the robot: its guard switches torque off from the next cycle on.

        Raises:
            FeedError: if the feed has ended.
        """
        try:
            self._connection.sendall(STOP)
        except OSError as error:
            raise FeedError("the live feed has ended: no robot was stopped") from error

    def close(self) -> None:
        """Stop to follow; the robot goes on."""
        with contextlib.suppress(OSError):
            self._connection.shutdown(socket.SHUT_RDWR)
        self._thread.join()
        self._connection.close()

    def _read(self) -> None:
        problem = ""
        try:
            while (sample := receive_message(self._connection, LiveSample)) is not None:
                try:
                    self._on_sample(sample)
                except Exception as error:  # the feed goes on, and so does its stop
                    problem = f"live feed: {type(error).__name__}: {error}"
        except FeedError as error:
            problem = str(error)
        except OSError:  # closed
            pass
        self._on_end(problem)
