"""Interface between control and hardware: a twin, a virtual bus or a real robot."""

from __future__ import annotations

from enum import Enum
from typing import Protocol, Self, runtime_checkable

from drivers.safety_limits import GuardLimits
from drivers.state import Command, State
from robots import Robot
from robots.servo import LimitMode


class Release(Enum):
    """State of the joints after `Backend.close`."""

    LIMP = "torque off"
    HOLD = "joints hold their positions for as long as the servos have power"


@runtime_checkable
class Backend(Protocol):
    """Hardware of a robot, or its simulation: it measures and moves; it does not know the task.

    One control period is one ``read`` and then one ``write``. Reading again before the next
    write may return the same measurement. Torque is off outside ``connect`` and ``close``,
    unless ``release`` says otherwise.
    In a ``with`` block the backend is connected, and closed at the end or after a failure.
    """

    robot: Robot
    period: float
    """Control period [s]."""
    limit_by: LimitMode
    """What the torque limits of commands act on."""
    release: Release = Release.LIMP
    """State of the joints after ``close``; `hand_over` changes it."""
    has_wire: bool = False
    """Whether each cycle waits for devices on a wire, and computes little meanwhile."""

    def connect(self) -> None:
        """Open the devices, torque off; harmless if they are open."""

    @property
    def unreleased(self) -> tuple[str, ...]:
        """Return the joints that had torque and did not confirm at ``close`` that it is off."""
        return ()

    def narrow(self, limits: GuardLimits) -> GuardLimits:
        """Narrow a guard's limits to those inside the devices, as read by ``connect``."""
        return limits

    def read(self) -> State:
        """Measure the robot."""
        ...

    def write(self, command: Command) -> Command:
        """Send a command; return the command that was really sent."""
        ...

    def close(self) -> None:
        """Release every joint and the devices; calling it twice is harmless.

        Raises:
            UnreleasedError: if joints that had torque do not confirm that it is off.
        """

    def hand_over(self) -> tuple[str, ...]:
        """Leave the joints under torque at ``close``, unless one does not confirm; return those."""
        self.release = Release.HOLD
        return ()

    def __enter__(self) -> Self:
        try:
            self.connect()
        except BaseException:
            self.close()
            raise
        return self

    def __exit__(self, *error: object) -> None:
        self.close()
