"""The seam between control and hardware: a twin, a virtual bus or a real robot."""

from __future__ import annotations

from types import TracebackType
from typing import Protocol, Self, runtime_checkable

from drivers.state import Command, State
from robots import Robot


@runtime_checkable
class Backend(Protocol):
    """A robot's body: it measures and it moves, and knows nothing of the task.

    One control period is one ``read`` and then one ``write``. Reading again before the
    next write may return the same measurement. Outside ``connect`` and ``close`` every
    joint is limp.
    """

    @property
    def robot(self) -> Robot:
        """Return the robot that this backend embodies."""
        ...

    @property
    def period(self) -> float:
        """Return the control period [s]."""
        ...

    def connect(self) -> None:
        """Open the devices, joints limp; harmless when they are open."""
        ...

    def read(self) -> State:
        """Measure the robot."""
        ...

    def write(self, command: Command) -> Command:
        """Send a command; return what was really sent."""
        ...

    def close(self) -> None:
        """Release every joint and the devices; calling it twice is harmless."""
        ...

    def __enter__(self) -> Self:
        """Connect."""
        ...

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Close."""
        ...


class ClosesItself:
    """Make a backend a context manager that is limp and closed on the way out."""

    def connect(self) -> None:
        """Open the devices."""
        raise NotImplementedError

    def close(self) -> None:
        """Release every joint and the devices."""
        raise NotImplementedError

    def __enter__(self) -> Self:
        """Connect; what opened before a failure is closed again."""
        try:
            self.connect()
        except BaseException:
            self.close()
            raise
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Close, whatever happened inside."""
        self.close()
