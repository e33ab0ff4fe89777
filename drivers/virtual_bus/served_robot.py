"""A simulated robot behind serial ports, in real time or in lock-step with its client."""

from __future__ import annotations

from collections.abc import Callable

from drivers.twin.simulation import Simulation
from drivers.virtual_bus.own_process.real_time_robot import RealTimeRobot
from drivers.virtual_bus.serving.server import PortOptions, TimeMode
from drivers.virtual_bus.servo_physics import HandledRobot
from drivers.virtual_bus.virtual_ports import VirtualPorts
from drivers.virtual_bus.virtual_robot import VirtualRobot


def serve_robot(
    simulation: Simulation,
    *,
    time_mode: TimeMode,
    options: PortOptions | None = None,
    powered: bool = False,
) -> ServedRobot:
    """Serve a simulated robot inside a ``with`` block; raise `SetupError` if it has no bus.

    ``powered`` says whether servos have power from the start, not only once the board switches it.
    """
    if time_mode is TimeMode.REAL_TIME:
        return RealTimeRobot(simulation, powered=powered, options=options)
    return LockStepRobot(VirtualRobot(simulation, powered=powered), options)


class LockStepRobot(VirtualPorts, HandledRobot):
    """A virtual robot that waits for its client."""

    behind = 0.0
    """The clock waits for physics."""

    def __init__(self, robot: VirtualRobot, options: PortOptions | None = None) -> None:
        """Prepare its ports."""
        super().__init__(robot, time_mode=TimeMode.LOCK_STEP, options=options)
        self._virtual = robot

    def rearrange(self, change: Callable[[Simulation], None], *, releases: bool = False) -> None:
        """Change the simulation by hand, between two instructions."""
        self.main.call(lambda: self._virtual.rearrange(change, releases=releases))


ServedRobot = RealTimeRobot | LockStepRobot
"""A robot whose ports are served inside a ``with`` block."""
