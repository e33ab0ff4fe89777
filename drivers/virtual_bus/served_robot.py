"""A simulated robot behind serial ports, in real time or in lock-step with its client."""

from __future__ import annotations

from drivers.twin.simulation import Simulation
from drivers.virtual_bus.own_process.real_time_robot import RealTimeRobot
from drivers.virtual_bus.serving.server import PortOptions, TimeMode
from drivers.virtual_bus.virtual_ports import VirtualPorts
from drivers.virtual_bus.virtual_robot import VirtualRobot
from robots import Posture


def serve_robot(
    simulation: Simulation,
    *,
    time_mode: TimeMode,
    options: PortOptions | None = None,
    powered: bool = False,
) -> ServedRobot:
    """Serve a simulated robot inside a ``with`` block.

    Args:
        simulation: The robot.
        time_mode: How time advances.
        options: Its ports, and what goes wrong there; None for the defaults.
        powered: Whether servos have power from the start, not only once the board switches it.

    Raises:
        SetupError: if the robot has no bus, or servos that cannot be driven.
    """
    if time_mode is TimeMode.REAL_TIME:
        return RealTimeRobot(simulation, powered=powered, options=options)
    return LockStepRobot(VirtualRobot(simulation, powered=powered), options)


class LockStepRobot(VirtualPorts):
    """A virtual robot that waits for its client."""

    def __init__(self, robot: VirtualRobot, options: PortOptions | None = None) -> None:
        """Prepare its ports."""
        super().__init__(robot, time_mode=TimeMode.LOCK_STEP, options=options)
        self._virtual = robot

    @property
    def behind(self) -> float:
        """Return 0: the clock waits for physics."""
        return 0.0

    def place(self, posture: Posture) -> None:
        """Place the robot at rest, cool, torque off."""
        self.main.call(lambda: self._virtual.place(posture))

    def hold(self, posture: Posture) -> None:
        """Place the robot at rest, cool, torque off, held by a person."""
        self.main.call(lambda: self._virtual.hold(posture))

    def turn(self, joint: int, by: float) -> None:
        """Turn a joint by an angle [rad], as a person does; see `Simulation.turn`."""
        self.main.call(lambda: self._virtual.physics.turn(joint, by))

    def let_go(self) -> None:
        """Let a robot go that is held."""
        self.main.call(self._virtual.physics.let_go)


ServedRobot = RealTimeRobot | LockStepRobot
"""A robot whose ports are served inside a ``with`` block."""
