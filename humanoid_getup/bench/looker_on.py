"""A backend around a backend, for benchmarks that look on."""

from __future__ import annotations

from drivers import Backend, Command, State
from drivers.backend import ClosesItself
from robots import Robot


class LookerOn(ClosesItself):
    """Hands everything through; who looks on overrides what it wants to see."""

    def __init__(self, backend: Backend) -> None:
        """Look on at a backend."""
        self._backend = backend

    @property
    def robot(self) -> Robot:
        """Return the robot."""
        return self._backend.robot

    @property
    def period(self) -> float:
        """Return the control period [s]."""
        return self._backend.period

    def connect(self) -> None:
        """Open the backend."""
        self._backend.connect()

    def close(self) -> None:
        """Close the backend."""
        self._backend.close()

    def read(self) -> State:
        """Measure."""
        return self._backend.read()

    def write(self, command: Command) -> Command:
        """Send a command."""
        return self._backend.write(command)
