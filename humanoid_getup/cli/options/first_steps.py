"""Options of `getup first-steps`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import arg

from humanoid_getup.jobs.requests.backend import PORT_EXAMPLE, Ports
from humanoid_getup.jobs.requests.files import FOLDER
from humanoid_getup.jobs.requests.shared import RobotOption
from humanoid_getup.jobs.requests.values import between


@dataclass(frozen=True, kw_only=True)
class FirstSteps(RobotOption):
    """Lead through the first connection: scan, doctor, calibrate, wiggle, squat, first rise.

    Each step is a command of getup that is shown, and runs after Enter. What is done is kept, so
    that the next start goes on where this one ended. Find the port with getup servo find-port.
    """

    port: Ports = ()
    """Serial port; of a robot with several, NAME=PATH of each."""
    desk: bool = False
    """Loose servos on a desk instead of a robot."""
    torque_limit: Annotated[float | None, between(0.001, 1000.0, "N·m"), arg(metavar="N·m")] = None
    """Torque limit per servo of the first rise [N·m]; default: 60 % of the stall torque of the
    strongest."""
    step: Annotated[str | None, arg(metavar="NAME")] = None
    """Step to begin with; default: the first that is not done."""
    out: Annotated[Path | None, FOLDER, arg(metavar="DIR")] = None
    """Folder for what is done, reports and flight logs; default: out/first-steps/ROBOT."""

    def find_problems(self) -> list[str]:
        """Report a missing port, and several of a desk, as well."""
        problems = super().find_problems()
        if not self.port:
            problems.append(
                f"--port is missing, expected a serial port, {PORT_EXAMPLE}; getup servo find-port "
                "finds it"
            )
        if self.desk and len(self.port) > 1:
            problems.append(f"--port is {','.join(self.port)}, expected one serial port")
        return problems
