"""Serial ports on a command line."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from humanoid_getup.cli.errors import BadInputError

if TYPE_CHECKING:
    from robots import Robot


def find_port_faults(backend: str, ports: Sequence[str]) -> list[str]:
    """Report ports that a backend does not use, and ports that it lacks."""
    if backend == "twin" and ports:
        told = "expected --backend virtual or dynamixel with it"
        return [f"--port is {', '.join(ports)}, {told}"]
    if backend == "dynamixel" and not ports:
        return ["a robot on a bus requires --port, e.g. --port /dev/ttyUSB0"]
    return []


def name_ports(robot: Robot, ports: Sequence[str]) -> dict[str, str]:
    """Give each of a robot's ports its path.

    Raises:
        BadInputError: naming the ports that the robot has.
    """
    wanted = [port.name for port in robot.bus.ports] if robot.bus else []
    if len(wanted) == 1 and len(ports) == 1 and "=" not in ports[0]:
        return {wanted[0]: ports[0]}
    named = dict(port.split("=", 1) for port in ports if "=" in port)
    if len(named) != len(ports) or sorted(named) != sorted(wanted):
        told = " ".join(f"--port {name}=PATH" for name in wanted) or "none, it has no servo bus"
        raise BadInputError(
            f"--port is {', '.join(ports)}, expected for robot '{robot.name}': {told}"
        )
    return named
