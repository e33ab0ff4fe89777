"""Fields of requests that connect to a robot: simulated, behind a virtual bus, or real."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from tyro.conf import arg

from humanoid_getup.commands.options import JsonOption, Origin, RobotOption, SceneOptions

Ports = Annotated[tuple[str, ...], arg(metavar="PATH|NAME=PATH,...")]
PORT_EXAMPLE = "e.g. --port /dev/ttyUSB0"
NO_PORT = f"--port is missing, expected a serial port, {PORT_EXAMPLE}"


@dataclass(frozen=True, kw_only=True)
class BackendOptions(SceneOptions):
    """The robot to which a command connects, simulated or real."""

    backend: Literal["twin", "virtual", "dynamixel"] = "twin"
    """MuJoCo twin, virtual servos on a virtual bus, or a robot with Dynamixel servos."""
    port: Ports = ()
    """Serial port; for a robot with several, NAME=PATH of each. Without it, --backend virtual
    serves a virtual robot of its own."""
    realtime: bool = False
    """Run a simulated robot in real time."""

    def find_problems(self) -> list[str]:
        """Report wrong ports as well."""
        problems = super().find_problems()
        if self.backend == "twin" and self.port:
            ports = ", ".join(self.port)
            problems.append(f"--port is {ports}, expected --backend virtual or dynamixel with it")
        if self.backend == "dynamixel" and not self.port:
            problems.append(f"--backend dynamixel requires --port, {PORT_EXAMPLE}")
        return problems

    @property
    def is_real(self) -> bool:
        """Return whether the robot may be a real one."""
        return bool(self.port)

    @property
    def is_realtime(self) -> bool:
        """Return whether cycles keep the deadlines of the wall clock."""
        return self.realtime or self.is_real


@dataclass(frozen=True, kw_only=True)
class OriginOption(BackendOptions):
    """Start of a simulated robot."""

    origin: Origin = None

    def find_problems(self) -> list[str]:
        """Report a start that is chosen for a real robot as well."""
        problems = super().find_problems()
        if self.is_real and self.origin is not None:
            problems.append(
                f"--from is '{self.origin}', expected a simulated robot: a real one starts as it "
                "lies"
            )
        return problems


@dataclass(frozen=True, kw_only=True)
class ViewOptions(BackendOptions):
    """The robot that a command moves or reads, in a window."""

    view: bool = False
    """Show what the robot measures in MuJoCo's own viewer; a simulated one moves no faster than in
    real time."""


@dataclass(frozen=True, kw_only=True)
class ServiceOptions(JsonOption, RobotOption):
    """Options of the commands that service a robot on its bus."""

    port: Ports = ()
    """Serial port; of a robot with several, NAME=PATH of each."""

    def find_problems(self) -> list[str]:
        """Report missing ports as well."""
        return super().find_problems() + ([] if self.port else [NO_PORT])
