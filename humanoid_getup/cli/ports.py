"""Serial ports on a command line."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from humanoid_getup.cli.errors import BadInputError

if TYPE_CHECKING:
    from robots import Robot


def find_port_faults(backend: str | None, ports: Sequence[str]) -> list[str]:
    """Report ports that a backend does not use, or lacks; ``None``: a command for hardware."""
    example = "e.g. --port /dev/ttyUSB0"
    if backend == "twin" and ports:
        return [f"--port is {', '.join(ports)}, expected --backend virtual or dynamixel with it"]
    if backend == "dynamixel" and not ports:
        return [f"--backend dynamixel requires --port, {example}"]
    if backend is None and not ports:
        return [f"--port is missing, expected a serial port, {example}"]
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
